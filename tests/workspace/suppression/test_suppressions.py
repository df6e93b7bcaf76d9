"""`# codra: ignore[CODE] reason`: the findings that it silences, and the findings about it."""

from __future__ import annotations

import sys
from pathlib import Path
from types import FrameType

import pytest

from codra_dsl.language.diagnostics import Applicability, Severity
from tests.workspace.suppression.specs import JARS, KITCHEN, UNUSED, codes, lint, lint_files

COMMENT = "# codra: ignore[CDR7102] for the next demo"


def with_comment(comment: str = COMMENT) -> str:
    return KITCHEN.replace(UNUSED, f"{UNUSED[:-1]}  {comment}\n")


def above(*lines: str) -> str:
    return KITCHEN.replace(UNUSED, "".join(f"{line}\n" for line in lines) + UNUSED)


def test_without_a_comment_there_is_a_finding(tmp_path: Path) -> None:
    assert codes(lint(KITCHEN, tmp_path)) == ["CDR7102"]


@pytest.mark.parametrize(
    "text",
    [
        with_comment(),
        with_comment("#codra:ignore[ CDR7102 ]   for the next demo"),
        with_comment("# Codra : IGNORE [CDR7102]: for the next demo"),
        above(f"  {COMMENT}"),
        above(COMMENT, "  # another comment"),
        with_comment().replace("\n", "\r\n"),
        KITCHEN.replace(UNUSED, f"  unused:  {COMMENT}\n    type: bool\n    source: main_execution\n"),
        KITCHEN.replace(UNUSED, "  unused:\n    type: bool\n    source: main_execution\n").replace(
            "  unused", f"{COMMENT}\n  unused"
        ),
    ],
)
def test_a_comment_with_a_reason_silences_the_finding_of_its_line_or_the_next(tmp_path: Path, text: str) -> None:
    assert lint(text, tmp_path) == ()


@pytest.mark.parametrize(
    "text",
    [
        above(COMMENT, "  window: {type: bool, source: main_execution}"),
        KITCHEN + f"  # the end\n{COMMENT}\n",
        KITCHEN.replace("pour:\n", f"pour: {COMMENT}\n"),
    ],
)
def test_a_comment_elsewhere_is_unused(tmp_path: Path, text: str) -> None:
    reported_codes = codes(lint(text, tmp_path))

    assert "CDR7102" in reported_codes
    assert ("CDR7901" in reported_codes) == ("window" not in text)


def test_text_that_looks_like_a_comment_is_not_a_comment(tmp_path: Path) -> None:
    quoted = UNUSED.replace("}", f", label: '{COMMENT}'}}")
    block = f"  unused:\n    type: bool\n    source: main_execution\n    description: |\n      {COMMENT}\n"

    assert codes(lint(KITCHEN.replace(UNUSED, quoted), tmp_path)) == ["CDR7102"]
    assert codes(lint(KITCHEN.replace(UNUSED, block), tmp_path)) == ["CDR7102"]


def test_a_comment_without_a_reason_is_an_error_in_place_of_the_silenced_finding(tmp_path: Path) -> None:
    (finding,) = lint(with_comment("# codra: ignore[CDR7102]"), tmp_path)

    assert (finding.code, finding.severity) == ("CDR7902", Severity.ERROR)
    assert finding.place.span.line == 5


def test_an_unused_comment_is_reported_and_can_be_removed(tmp_path: Path) -> None:
    text = with_comment().replace("preview: [pot_full]", "preview: [pot_full, unused]")

    (finding,) = lint(text, tmp_path)

    assert finding.code == "CDR7901"
    assert finding.fix is not None
    assert finding.fix.applicability is Applicability.SAFE


def test_a_misplaced_comment_is_not_removed(tmp_path: Path) -> None:
    text = KITCHEN.replace("preview: [pot_full]", "preview: [pot_full]  " + COMMENT)

    _, finding = lint(text, tmp_path)

    assert (finding.code, finding.fix) == ("CDR7901", None)
    assert finding.help == "move it to line 5, which has such a finding, or remove it"


def test_of_several_codes_the_unused_ones_are_reported(tmp_path: Path) -> None:
    (finding,) = lint(with_comment("# codra: ignore[CDR7102, CDR7103] two"), tmp_path)

    span = finding.place.span
    assert (finding.code, "CDR7103" in finding.message) == ("CDR7901", True)
    assert with_comment("# codra: ignore[CDR7102, CDR7103] two").splitlines()[4][span.column - 1 :][:7] == "CDR7103"


def test_while_there_is_an_error_no_comment_is_called_unused(tmp_path: Path) -> None:
    """The error may hide the finding that the comment silences."""
    text = KITCHEN.replace("preview: [pot_full]", "preview: [pot_fully]  " + COMMENT)

    assert codes(lint(text, tmp_path)) == ["CDR7102", "CDR3101"]


@pytest.mark.parametrize(
    ("comment", "code", "help"),
    [
        ("# codra: ignore[CDR7192] typo", "CDR7903", "did you mean 'CDR7102'?"),
        ("# codra: ignore[cdr7102] small letters", "CDR7903", "did you mean 'CDR7102'?"),
        ("# codra: ignore[unreached-variable] name", "CDR7903", "did you mean 'CDR7102'?"),
        ("# codra: ignore[CDR3101] error", "CDR7904", "remove the code; correct the spec"),
        ("# codra: ignore[CDR7901] itself", "CDR7904", "remove the code; correct the spec"),
        ("# codra: ignore everything", "CDR7905", "write '# codra: ignore[CDR7102] reason'"),
        ("# codra: ignore[] nothing", "CDR7905", "write '# codra: ignore[CDR7102] reason'"),
        ("# codra: ignroe[CDR7102] typo", "CDR7905", "write '# codra: ignore[CDR7102] reason'"),
        ("# codra: noqa CDR7102", "CDR7905", "write '# codra: ignore[CDR7102] reason'"),
    ],
)
def test_a_comment_that_cannot_silence_is_reported_with_the_finding(
    tmp_path: Path, comment: str, code: str, help: str
) -> None:
    text = with_comment(comment)

    findings = lint(text, tmp_path)

    assert sorted(codes(findings)) == ["CDR7102", code]
    assert next(finding.help for finding in findings if finding.code == code) == help


@pytest.mark.parametrize("comment", ["# codra: 1 is the version", "# codra lint finds nothing", "# see codra: ignore"])
def test_other_comments_about_codra_are_ignored(tmp_path: Path, comment: str) -> None:
    assert codes(lint(with_comment(comment), tmp_path)) == ["CDR7102"]


def test_errors_that_prevent_compiling_cannot_be_silenced(tmp_path: Path) -> None:
    text = KITCHEN.replace("[pot_full]", "[pot_fully]  # codra: ignore[CDR3101] later")

    assert set(codes(lint(text, tmp_path))) == {"CDR7102", "CDR3101", "CDR7904"}


def test_an_error_of_context_quality_can_be_silenced_and_the_spec_is_compiled(tmp_path: Path) -> None:
    text = """\
codra: 1
name: door
context:
  near: {type: bool, source: main_execution}  # codra: ignore[CDR7101] the base never drifts
  door_open: {type: bool}
perception:
  look: {call: a.b:c, returns: {x: {type: bool}}, observable_when: [near], identifies: {door_open: x}}
"""
    planned = lint_files(tmp_path, "door.yaml", door=text)

    assert planned.diagnostics == ()
    assert [plan.name for plan in planned.plans] == ["door"]


# Templates


def test_at_the_template_s_line_a_comment_silences_every_use(tmp_path: Path) -> None:
    assert codes(lint(JARS, tmp_path)) == ["CDR7102"]
    assert lint(JARS.replace("    context:\n      $", f"    context:\n      {COMMENT}\n      $"), tmp_path) == ()


def test_at_a_use_s_line_a_comment_silences_that_use(tmp_path: Path) -> None:
    (finding,) = lint(JARS.replace("  sugar: {template: jar}", f"  sugar: {{template: jar}}  {COMMENT}"), tmp_path)

    assert finding.place.use is not None
    assert finding.place.use.line == 9
    assert [related.place.use.line for related in finding.related if related.place.use] == [10]


def test_when_every_use_is_silenced_no_finding_is_left(tmp_path: Path) -> None:
    assert lint(JARS.replace("{template: jar}\n", f"{{template: jar}}  {COMMENT}\n"), tmp_path) == ()


# Parts


PART = "codra: 1\ncontext:\n" + UNUSED
WHOLE = KITCHEN.replace("name: kitchen\n", "name: kitchen\ninclude: [parts/more.yaml]\n").replace(UNUSED, "")


def test_comments_work_in_parts(tmp_path: Path) -> None:
    silenced = PART.replace(UNUSED, f"{UNUSED[:-1]}  {COMMENT}\n")

    planned = lint_files(tmp_path, "kitchen.yaml", kitchen=WHOLE, parts__more=silenced)

    assert planned.diagnostics == ()


def test_a_comment_in_a_part_is_called_unused_only_if_the_part_s_folder_was_linted(tmp_path: Path) -> None:
    """Another spec may include the part."""
    idle = PART.replace(UNUSED, f"  pot_hot: {{type: bool, source: main_execution}}  {COMMENT}\n")
    kitchen_with_pot_hot = WHOLE.replace("[pot_full]", "[pot_full, pot_hot]")

    assert codes(lint_files(tmp_path, "kitchen.yaml", kitchen=kitchen_with_pot_hot, parts__more=idle).diagnostics) == []
    assert codes(lint_files(tmp_path, ".", kitchen=kitchen_with_pot_hot, parts__more=idle).diagnostics) == ["CDR7901"]


def test_a_comment_that_silences_in_one_of_two_specs_is_used(tmp_path: Path) -> None:
    part = PART.replace(UNUSED, f"{UNUSED[:-1]}  {COMMENT}\n")
    other = WHOLE.replace("name: kitchen", "name: other").replace("[pot_full]", "[pot_full, unused]")

    assert lint_files(tmp_path, ".", kitchen=WHOLE, other=other, parts__more=part).diagnostics == ()


# Together with settings


def test_a_comment_for_an_ignored_code_is_still_used(tmp_path: Path) -> None:
    assert lint(with_comment(), tmp_path, 'ignore = ["CDR7102"]') == ()


def test_settings_raise_severities_and_ignore_codes(tmp_path: Path) -> None:
    (raised,) = lint(KITCHEN, tmp_path, 'severity = {CDR7102 = "error"}')

    assert raised.severity is Severity.ERROR
    assert raised.rule.severity is Severity.WARNING
    assert lint(KITCHEN, tmp_path, 'ignore = ["CDR71"]') == ()


def test_errors_in_settings_are_among_the_findings(tmp_path: Path) -> None:
    assert codes(lint(KITCHEN, tmp_path, "selct = []")) == ["CDR7102", "CDR0021"]


def test_the_work_for_many_comments_grows_with_their_number(tmp_path: Path) -> None:
    """Each comment on a line of its own is followed by all others, and then by the line that it is about."""
    call_count = 0

    def count(_: FrameType, event: str, __: object) -> None:
        nonlocal call_count
        call_count += event == "c_call"

    def work(comment_count: int) -> int:
        nonlocal call_count
        call_count = 0
        before = sys.getprofile()
        sys.setprofile(count)
        try:
            assert lint(above(*[COMMENT] * comment_count), tmp_path) == ()
        finally:
            sys.setprofile(before)
        return call_count

    work(1)
    assert work(400) < 3 * work(200)


def test_of_very_many_codes_in_a_comment_the_first_ones_count(tmp_path: Path) -> None:
    text = with_comment(f"# codra: ignore[CDR7102, {'CDR7115, ' * 5000}] too many")

    assert codes(lint(text, tmp_path)) == ["CDR7901"] * 999
    assert "CDR7102" in codes(lint(text.replace("CDR7102, ", "").replace("CDR7115, ]", "CDR7102]"), tmp_path))
