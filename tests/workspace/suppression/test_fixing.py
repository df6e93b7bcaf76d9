"""Safe fixes have the right effects, terminate, change only what they fix, and never cause an error."""

from __future__ import annotations

import random
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cache, lru_cache
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.compiler import plan_text
from codra_dsl.language.diagnostics import Applicability, Diagnostic, Edit, Fix, Place, Rule, Severity, Span, is_safe
from codra_dsl.workspace.suppression import FixResult, fix_all
from tests.workspace.suppression.specs import KITCHEN, UNUSED

ROOT = Path(__file__).parents[3]
CASES = ROOT / "tests" / "cases"
INVALID = sorted(path for path in (CASES / "invalid").glob("*.yaml"))
VALID = sorted([*(CASES / "valid").glob("*.yaml"), *(ROOT / "specs").glob("*.yaml")])
MARK = b"\xef\xbb\xbf"


@lru_cache(maxsize=16)
def linted(data: bytes, root: Path, file: str) -> Sequence[Diagnostic]:
    """Return the findings about a text. They are cached, because fixes and assertions need them several times."""
    return plan_text(data, file, root).diagnostics


def fixed(data: str | bytes, root: Path = CASES / "invalid", file: str = "-") -> FixResult:
    original = data.encode() if isinstance(data, str) else data
    return fix_all(lambda texts: linted(texts.get(file, original), root, file), {file: original})


def after(data: str | bytes, root: Path = CASES / "invalid", file: str = "-") -> bytes:
    original = data.encode() if isinstance(data, str) else data
    return fixed(original, root, file).texts.get(file, original)


def errors(data: bytes, root: Path, file: str = "-") -> Counter[tuple[str, str]]:
    findings = linted(data, root, file)
    return Counter((finding.code, finding.message) for finding in findings if finding.severity is Severity.ERROR)


def spec(context: str = "", skills: str = "", perception: str = "") -> str:
    return f"""\
codra: 1
name: kitchen
context:
  pot_full: {{type: bool, source: main_execution}}
  stove: {{type: enum, values: [off_now, heating], source: main_execution}}
{context}skills:
  pour: {{preview: [pot_full, stove]}}
  clean: {{changes: [pot_full]}}
{skills}{perception}"""


ALGORITHM = """\
perception:
  look:
    call: kitchen.perception:look
    returns:
      {{level: {{type: float, unit: m}}, state: {{type: enum, values: [cold, hot]}}, lid: {{type: bool}}{returns}}}
    accept_when: {accept}
    identifies: {{pot_hot: level > 1 cm}}
"""


def algorithm(accept: str, returns: str = "") -> str:
    seen = "  pot_hot: {type: bool, valid_for: 1 min}\n"
    return spec(context=seen, perception=ALGORITHM.format(accept=accept, returns=returns)).replace(
        "[pot_full, stove]", "[pot_full, stove, pot_hot]"
    )


LISTED = spec().replace(
    "{preview: [pot_full, stove]}", "\n    preview:\n      - pot_full\n      - stove\n    changes: []"
)


@pytest.mark.parametrize(
    ("wrong", "right"),
    [
        # Keys and values with a fixed set of choices
        (spec().replace("preview", "perview"), spec()),
        (spec().replace("context:", '"contxt":'), spec()),
        (spec().replace("type: bool", "type: boolean"), spec()),
        (spec().replace("type: enum", "type: enumm"), spec()),
        # Names
        (spec().replace("main_execution", "main_executoin", 1), spec()),
        (spec().replace("preview: [pot_full", "preview: [pot_ful"), spec()),
        (spec().replace("preview: [pot_full", "preview: [Pot_Full"), spec()),
        (spec().replace("preview: [pot_full", "preview: [potfull"), spec()),
        (algorithm("[levl > 0 m]"), algorithm("[level > 0 m]")),
        # Members and truth values
        (algorithm('[state != "hot", state == "hott"]'), algorithm('[state != "hot", state == "hot"]')),
        (algorithm("[state == hot]"), algorithm('[state == "hot"]')),
        (algorithm("[lid == yes]"), algorithm("[lid == true]")),
        (algorithm("[lid == Off]"), algorithm("[lid == false]")),
        (
            algorithm("[lid]", ", x: {type: bool, optional: yes}"),
            algorithm("[lid]", ", x: {type: bool, optional: true}"),
        ),
        (
            algorithm("[lid]", ", x: {type: bool, optional: NO}"),
            algorithm("[lid]", ", x: {type: bool, optional: false}"),
        ),
        # Conditions that YAML splits or reinterprets
        (algorithm('[state in ("hot", "cold")]'), algorithm('[\'state in ("hot", "cold")\']')),
        (algorithm("[min(level, 1 m) > 0 m]"), algorithm("['min(level, 1 m) > 0 m']")),
        (algorithm("[!lid]"), algorithm("[not lid]")),
        (algorithm('["cold" == state]'), algorithm("['\"cold\" == state']")),
        # Lists
        (spec().replace("[pot_full, stove]", "[pot_full, stove, pot_full]"), spec()),
        (spec().replace("[pot_full, stove]", "[pot_full, stove,\n  pot_full ]"), spec().replace("stove]", "stove ]")),
        (LISTED.replace("      - stove\n", "      - stove\n      - pot_full  \n"), LISTED),
        # The version
        (spec().replace("codra: 1\n", ""), spec()),
        ("# of the kitchen\n" + spec().replace("codra: 1\n", ""), "# of the kitchen\n" + spec()),
        (spec().replace("codra: 1\nname: kitchen\n", "name: kitchen\ncodra: 1\n"), spec()),
        (spec().replace("codra: 1\n", "") + "codra: 1", spec()),
        # A fix after another
        (spec().replace("preview: [pot_full", "perview: [pot_ful"), spec()),
        (
            KITCHEN.replace(UNUSED, "").replace("pot_full]", "pot_full]  # codra: ignore[CDR7102, CDR7103] x"),
            KITCHEN.replace(UNUSED, ""),
        ),
    ],
)
def test_an_unambiguous_error_is_corrected(wrong: str, right: str) -> None:
    assert after(wrong).decode() == right


@pytest.mark.parametrize(
    "text",
    [
        spec().replace("pot_full", "pot_full_1", 1),  # another number
        spec("  pot_fall: {type: bool, source: main_execution}\n").replace("[pot_full", "[pot_fill"),  # two candidates
        spec(skills="  boil: {preview: [pot_ful]}\n").replace("[pot_full", "[pot_ful"),  # twice: a separate name?
        spec().replace("type: bool", "type: number"),  # int or float
        spec()
        .replace("clean: {changes: [pot_full]}", "clean: {changes: []}")
        .replace("[pot_full", "[pot_ful"),  # ambiguous
        algorithm('[state == "warm"]'),
        algorithm("[hot == state]"),  # YAML would interpret the quotes of "hot" as its own
        algorithm("[state in (hot, cold)]"),  # quotes alone would give unknown names
        spec().replace("stove]", "stove,  # first\n    pot_full]"),  # a comment would be lost
        "{codra: 1, name: kitchen}",
        "{name: kitchen, context: {a: {type: bool, source: main_execution}}}",
    ],
)
def test_an_ambiguous_error_is_not_fixed(text: str) -> None:
    assert after(text) == text.encode()


def test_a_list_of_parameters_with_duplicates_is_left_alone() -> None:
    text = """\
codra: 1
name: jars
context:
  lid: {type: bool, source: main_execution}
templates:
  jar:
    parameters: {first: identifier, second: identifier}
    skills:
      fill_$(instance): {preview: [$(first), $(second)]}
use:
  sugar: {template: jar, first: lid, second: lid}
"""
    assert after(text) == text.encode()


def test_findings_outside_of_templates_are_fixed_in_a_file_with_templates() -> None:
    data = (CASES / "invalid" / "template-mistakes.yaml").read_bytes()

    assert b"other: identifer\n" in data
    assert b"other: identifier\n" in after(data)


JARS = """\
codra: 1
name: jars
templates:
  glass_jar:
    parameters: {title: str}
    context:
      $(instance)_full: {type: bool, source: main_execution, label: $(title), description: of $(title)}
use:
  salt: {template: glass_jar, title: salt}
  sugar: {template: glass_jar, title: sugar}
skills:
  pour: {preview: [sugar_full, salt_full]}
"""


@pytest.mark.parametrize(
    ("right", "wrong"),
    [("glass_jar, title: su", "glas_jar, title: su"), ("title: sugar", "titel: sugar"), ("of $(title)", "of $(tilte)")],
)
def test_templates_arguments_and_parameters_are_fixed(right: str, wrong: str) -> None:
    assert after(JARS.replace(right, wrong, 1)).decode() == JARS


# For every file: fixing terminates, leaves the rest, and causes no error


@pytest.mark.parametrize("path", [*INVALID, *VALID], ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_fixing_again_changes_no_byte_and_causes_no_error(path: Path) -> None:
    data = path.read_bytes()

    first = after(data, path.parent)

    assert after(first, path.parent) == first
    assert errors(first, path.parent) <= errors(data, path.parent)


@pytest.mark.parametrize(
    "path", [path for path in INVALID if b"\r" not in path.read_bytes()], ids=lambda path: path.stem
)
def test_line_ends_and_a_byte_order_mark_are_preserved(path: Path) -> None:
    data = path.read_bytes().removeprefix(MARK)
    plain = after(data, path.parent)

    assert after(data.replace(b"\n", b"\r\n"), path.parent) == plain.replace(b"\n", b"\r\n")
    assert after(MARK + data, path.parent) == MARK + plain


def misspelt(word: str, chance: random.Random) -> str:
    """Swap, drop, double or replace a letter."""
    at = chance.randrange(len(word) - 1)
    kind = chance.randrange(4)
    if kind == 0:
        return word[:at] + word[at + 1] + word[at] + word[at + 2 :]
    if kind == 1:
        return word[:at] + word[at + 1 :]
    return word[:at] + (word[at] * 2 if kind == 2 else "x") + word[at + 1 :]


WORD = re.compile(r"[A-Za-z][A-Za-z_]{3,}")


@cache
def valid(path: Path) -> tuple[str, list[tuple[int, int]]]:
    text = path.read_text("utf-8")
    return text, [match.span() for match in WORD.finditer(text)]


@settings(max_examples=25)
@given(st.sampled_from(VALID), st.integers(0, 10**9), st.integers(1, 3))
def test_specs_with_misspelt_words_get_no_new_error_and_change_only_where_fixed(
    path: Path, seed: int, number: int
) -> None:
    chance = random.Random(seed)
    text, words = valid(path)
    wrong = text
    for start, end in sorted(chance.sample(words, number), reverse=True):
        wrong = wrong[:start] + misspelt(text[start:end], chance) + wrong[end:]
    root, file = (ROOT, f"specs/{path.name}") if path.parent.name == "specs" else (path.parent, "-")

    done = fixed(wrong, root, file)
    right = done.texts.get(file, wrong.encode())

    assert after(right, root, file) == right
    assert errors(right, root, file) <= errors(wrong.encode(), root, file)
    touched = {
        edit.span.line
        for diagnostic in done.fixed_findings
        for edit in (diagnostic.fix.edits if diagnostic.fix else ())
    }
    lines = zip(wrong.split("\n"), right.decode().split("\n"), strict=True)
    assert {number for number, (old, new) in enumerate(lines, start=1) if old != new} <= touched
    assert done.diagnostics == plan_text(right, file, root).diagnostics


@pytest.mark.parametrize(
    "key", ["preview", "context", "identifies", "returns", "observable_when", "when_unobservable", "source"]
)
def test_a_misspelt_key_is_corrected_byte_for_byte(key: str) -> None:
    path = ROOT / "specs" / "kitchen.yaml"
    text, _ = valid(path)
    chance = random.Random(key)
    for match in re.finditer(rf"\b{key}(?=:)", text):
        wrong = text[: match.start()] + misspelt(key, chance) + text[match.end() :]

        assert after(wrong, ROOT, "specs/kitchen.yaml").decode() == text


# Combinations of fixes


RULE = Rule(code="CDR3999", name="example", severity=Severity.ERROR)


def finding(message: str, *edits: tuple[int, int, str]) -> Diagnostic:
    spans_and_texts = [(Span("f", 1, start, 1, end), text) for start, end, text in edits]
    fix = Fix(
        message="fix",
        edits=tuple(Edit(*span_and_text) for span_and_text in spans_and_texts),
        applicability=Applicability.SAFE,
    )
    return Diagnostic(rule=RULE, message=message, place=Place(spans_and_texts[0][0]), fix=fix)


class Words:
    """A language of words in which lower-case letters and a capital X are errors."""

    def __init__(self, text: bytes) -> None:
        self.text = text

    def lint(self, texts: Mapping[str, bytes]) -> Sequence[Diagnostic]:
        text = texts.get("f", self.text).decode()
        small = [(match.start() + 1, match[0]) for match in re.finditer("[a-z]", text)]
        findings = [finding(f"small {letter}", (column, column + 1, letter.upper())) for column, letter in small]
        return [
            *findings,
            *[Diagnostic(rule=RULE, message="an X", place=Place(Span("f", 1, 1, 1, 1)))] * text.count("X"),
        ]

    def fixed(self) -> FixResult:
        return fix_all(self.lint, {"f": self.text})


@given(st.lists(st.sampled_from("abx "), max_size=12).map("".join))
def test_a_fix_that_causes_an_error_is_undone_and_the_others_stay(text: str) -> None:
    done = Words(text.encode()).fixed()

    expected = text.replace("a", "A").replace("b", "B")
    assert done.texts.get("f", text.encode()).decode() == expected
    assert all(is_safe(diagnostic) for diagnostic in done.fixed_findings)


def test_of_two_overlapping_fixes_the_first_is_applied_and_the_other_one_is_not() -> None:
    def lint(texts: Mapping[str, bytes]) -> Sequence[Diagnostic]:
        text = texts.get("f", b"abcd")
        if text == b"abcd":
            return [finding("first", (1, 3, "X")), finding("second", (2, 4, "Y"))]
        return [finding("then", (2, 3, "Z"))] if text == b"Xcd" else []

    assert fix_all(lint, {"f": b"abcd"}).texts == {"f": b"XZd"}


def test_cyclic_fixes_terminate() -> None:
    def lint(texts: Mapping[str, bytes]) -> Sequence[Diagnostic]:
        text = texts.get("f", b"a")
        return [finding("turn", (1, 2, "b" if text == b"a" else "a"))]

    done = fix_all(lint, {"f": b"a"})

    assert bool(done.texts) == bool(done.fixed_findings)


def test_a_file_that_may_not_be_changed_is_left_alone() -> None:
    assert Words(b"ab").fixed().texts == {"f": b"AB"}
    assert fix_all(Words(b"ab").lint, {}).texts == {}
