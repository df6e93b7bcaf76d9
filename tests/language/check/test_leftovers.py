"""CDR7111 to CDR7115: unused declarations, and names that are easily confused."""

from __future__ import annotations

from pathlib import Path

import pytest

from codra_dsl.language.check import check
from codra_dsl.language.load import load_spec, load_text
from tests.language.check.specs import findings, marked_text

SPEC = """\
codra: 1
name: kitchen
context:
  near: {type: bool, source: page, valid_for: 10 s}
  door: {type: bool, label: Front door}
resources:
  camera: {}
agents:
  page: {}
templates:
  jar:
    parameters: {title: str, part: {type: identifier, default: lid}}
    context:
      $(instance)_full: {type: bool, label: $(title)}
      $(part)_of_$(instance): {type: bool, source: page}
    perception:
      look_into_$(instance):
        call: kitchen.perception:look
        returns: {full: {type: bool}}
        observable_when: [near]
        identifies: {$(instance)_full: full}
use:
  sugar: {template: jar, title: Sugar}
perception:
  look:
    call: kitchen.perception:look
    uses: {camera: read}
    returns: {open: {type: bool}}
    identifies: {door: open}
"""
POT = """\
  pot:
    parameters: {eye: identifier, who: identifier}
    context:
      $(instance)_full: {type: bool, source: [page, SOURCE]}
    perception:
      look_into_$(instance):
        call: kitchen.perception:look
        with: {one: $(eye), other: $(who)}
        uses: {RESOURCE: read}
        returns: {full: {type: bool}}
        identifies: {$(instance)_full: full}
use:
"""


def edit_spec(*edits: tuple[str, str]) -> str:
    text = SPEC
    for old, new in edits:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


def rules_and_marked_texts(*edits: tuple[str, str]) -> list[tuple[str, str]]:
    """Return the rule and the marked text of each finding."""
    text = edit_spec(*edits)
    return [(finding.rule.name, marked_text(text, finding)) for finding in findings(text)]


def test_used_declarations_are_no_finding() -> None:
    assert rules_and_marked_texts() == []


def test_an_unused_resource_is_reported() -> None:
    assert rules_and_marked_texts(("  camera: {}\n", "  camera: {}\n  vision: {slots: 2}\n")) == [
        ("unused-resource", "vision")
    ]


def test_an_agent_that_is_no_source_is_reported() -> None:
    assert rules_and_marked_texts(("  page: {}\n", "  page: {}\n  porter: {}\n")) == [("unused-agent", "porter")]


def test_a_misspelt_use_or_source_is_the_only_finding() -> None:
    assert rules_and_marked_texts(("uses: {camera: read}", "uses: {camra: read}")) == [("unknown-resource", "camra")]
    wrong_edits = [
        ("near: {type: bool, source: page", "near: {type: bool, source: pag"),
        ("source: page}\n    perc", "source: main_execution}\n    perc"),
    ]
    assert rules_and_marked_texts(*wrong_edits) == [("unknown-source", "pag")]


def test_an_unused_template_is_reported() -> None:
    assert rules_and_marked_texts(("  sugar: {template: jar, title: Sugar}\n", "")) == [("unused-template", "jar")]


def test_a_template_in_a_wrong_use_is_not_reported_as_unused() -> None:
    spec, diagnostics = load_text(edit_spec(("title: Sugar}", "title: Sugar, size: 3}")), "spec.yaml", Path())
    assert spec is not None
    assert [finding.rule.name for finding in (*diagnostics, *check(spec)[1])] == ["unknown-argument"]


@pytest.mark.parametrize(
    ("resource", "source", "unused"),
    [
        ("lidar", "porter", []),
        ("$(eye)", "$(who)", []),
        ("l$(eye)r", "p$(who)", []),
        ("camera", "$(who)_page", ["unused-agent", "unused-resource"]),
        ("$(eye)_camera", "porter", ["unused-resource"]),
    ],
)
def test_elements_that_an_unused_template_may_name_are_not_reported_as_unused(
    resource: str, source: str, unused: list[str]
) -> None:
    pot = POT.replace("RESOURCE", resource).replace("SOURCE", source)
    reported_rules = rules_and_marked_texts(
        ("use:\n", pot),
        ("  camera: {}\n", "  camera: {}\n  lidar: {}\n"),
        ("  page: {}\n", "  page: {}\n  porter: {}\n"),
    )
    assert sorted(rule for rule, _ in reported_rules) == sorted([*unused, "unused-template"])


@pytest.mark.parametrize("name", ["near", "door", "camera", "look", "page", "sugar_full_too"])
def test_a_parameter_with_a_name_that_its_template_can_read_is_reported(name: str) -> None:
    edits = [
        ("title: str, part", f"title: str, {name}: str, part"),
        ("label: $(title)}", f"label: $(title) $({name})}}"),
    ]
    reported_rules = rules_and_marked_texts(*edits, ("title: Sugar}", f"title: Sugar, {name}: x}}"))
    assert reported_rules == ([] if name == "sugar_full_too" else [("shadowed-name", name)])


def test_a_parameter_may_have_the_name_of_an_element_of_its_own_template() -> None:
    parameter_edits = [("part: {type: identifier, default: lid}", "lid_of_sugar: {type: identifier, default: lid}")]
    assert (
        rules_and_marked_texts(
            *parameter_edits, ("      $(part)_of_$(instance)", "      $(lid_of_sugar)_of_$(instance)")
        )
        == []
    )


@pytest.mark.parametrize(
    ("edits", "offender"),
    [
        ([("title: Sugar}", "title: front DOOR}")], "$(title)"),
        ([("title: Sugar}", "title: Near}")], "$(title)"),
        ([("label: Front door", "label: sugar_full")], "sugar_full"),
        ([("label: Front door", "label: NEAR")], "NEAR"),
    ],
)
def test_labels_that_look_the_same_are_reported(edits: list[tuple[str, str]], offender: str) -> None:
    assert rules_and_marked_texts(*edits) == [("same-label", offender)]


@pytest.mark.parametrize("label", ["door", "Door", "front-door 2", "sugar full"])
def test_different_labels_are_no_finding(label: str) -> None:
    assert rules_and_marked_texts(("label: Front door", f"label: {label}")) == []


def test_declarations_of_a_part_may_be_for_another_spec(tmp_path: Path) -> None:
    head, templates, rest = SPEC.partition("templates:\n")
    jar, use, _ = rest.partition("use:\n")
    (tmp_path / "part.yaml").write_text(
        f"codra: 1\nresources: {{lidar: {{}}}}\nagents: {{porter: {{}}}}\n{templates}{jar}", "utf-8"
    )
    (tmp_path / "spec.yaml").write_text(
        head.replace("name: kitchen\n", "name: kitchen\ninclude: [part.yaml]\n")
        + SPEC[SPEC.index("perception:\n  look:") :],
        "utf-8",
    )
    spec, diagnostics = load_spec(tmp_path / "spec.yaml", tmp_path)
    assert spec is not None
    assert (diagnostics, check(spec)[1], use) == ((), (), "use:\n")
