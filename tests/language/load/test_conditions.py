from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.language.expression import Name, names_in
from codra_dsl.language.model import Condition

from .texts import ALGORITHM, condition_of, findings_of, marked, rules_of

AS_WRITTEN = [
    "    accept_when: [x > 3 and state == 'a']\n",
    "    accept_when: ['x > 3 and state == ''a''']\n",
    '    accept_when: ["x > 3 and state == \\"a\\""]\n',
    '    accept_when: ["x > \\x33 and\\tstate == \\u0027a\'"]\n',
    "    accept_when:\n      - x > 3\n        and state\n          == 'a'\n",
    "    accept_when:\n      - 'x > 3\n\n        and state\n          == ''a'''\n",
    "    accept_when:\n      - \"x > 3 \\\n        and sta\\\n        te == 'a'\"\n",
    "    accept_when:\n      - >-\n        x > 3\n        and state ==\n        'a'\n",
    "    accept_when:\n      - |\n        x > 3\n        and state\n        == 'a'\n\n",
    "    accept_when:\n      - >\n         x > 3\n         and state == 'a'\n",
    "    accept_when:\n      - '  x > 3 and state == ''a'' '\n",
    "    accept_when:\r\n      - x > 3\r\n        and state == 'a'\r\n",
]


def marks(text: str, condition: Condition) -> dict[str, str]:
    """Return the text at the place of each name of a condition."""
    assert condition.tree is not None
    return {name.name: marked(text, condition.place_of(name)) for name in names_in(condition.tree)}


@pytest.mark.parametrize("keys", AS_WRITTEN)
def test_names_of_a_condition_have_their_places_in_the_file(keys: str) -> None:
    condition = condition_of(keys)
    broken = {"state": "sta\\\n        te"} if "sta\\\n" in keys else {"state": "state"}

    assert marks(ALGORITHM + keys, condition) == {"x": "x"} | broken
    assert "\n" not in condition.text


def test_the_place_of_a_condition_is_its_scalar_with_quotes() -> None:
    keys = "    accept_when: ['x > 3']\n"

    assert marked(ALGORITHM + keys, condition_of(keys).place) == "'x > 3'"


def test_a_mistake_in_a_folded_condition_is_marked_at_its_place() -> None:
    text = ALGORITHM + "    accept_when:\n      - 'x > 3 and\n        x < ''b'' and x < 5 cmm'\n"
    (finding,) = findings_of(text)

    assert (finding.rule.name, marked(text, finding.place)) == ("condition-syntax", "cmm")


@given(
    st.lists(st.sampled_from(["x", "state", "x > 3", '"it\'s"', "(x)", "1 m", "and", "or"]), min_size=1, max_size=12),
    st.sampled_from([" ", "  ", "\n        ", " \n\n        "]),
    st.sampled_from(["'", '"', "", ">", "|"]),
)
def test_every_letter_of_a_condition_has_its_place(words: list[str], blank: str, style: str) -> None:
    joined = blank.join(words)
    written = {
        "'": "'" + joined.replace("'", "''") + "'",
        '"': '"' + joined.replace('"', '\\"') + '"',
        "": joined,
    }.get(style, f"{style}\n        {joined}")
    if style == "" and ('"' in joined or words[0] == '"it\'s"'):
        return
    text = f"{ALGORITHM}    accept_when:\n      - {written}\n"
    from codra_dsl.language.load.yaml.compose import compose
    from codra_dsl.language.load.yaml.findings import Findings
    from codra_dsl.language.load.yaml.nodes import Style, scalars
    from codra_dsl.language.load.yaml.source import accept
    from codra_dsl.language.load.yaml.source_offsets import letter_runs
    from codra_dsl.language.model import Letters

    source = accept(text, "-", Findings())
    assert source is not None
    root = compose(source, Findings())
    assert root is not None
    *_, scalar = scalars(root, lambda _: True)
    letters = Letters(source.place, letter_runs(scalar, text))
    assert scalar.style is Style(style)
    for offset, letter in enumerate(scalar.text):
        if letter not in " \n":
            place = letters.place(offset, offset + 1)
            assert place is not None
            assert marked(text, place) in (letter, letter * 2, f"\\{letter}")


def test_a_comment_after_a_condition_that_is_prose_is_a_comment() -> None:
    assert rules_of(ALGORITHM + "    accept_when:\n      - x > 3 # near enough\n      - known(x)  # optional\n") == []


def test_a_comment_with_names_that_the_condition_could_use_is_reported() -> None:
    text = ALGORITHM + "    accept_when:\n      - x > 3 # state == 'a'\n"
    (finding,) = findings_of(text)

    assert (finding.rule.name, marked(text, finding.place)) == ("condition-in-comment", "x > 3")


@pytest.mark.parametrize(
    ("keys", "rule"),
    [
        ("accept_when: [x > min(3, 4)]", "torn-at-comma"),
        ('accept_when: [state in ("a", "b", "c")]', "torn-at-comma"),
        ('accept_when: [state in (a, "b")]', "torn-at-comma"),
        ('accept_when: [state == "a, b"]', "torn-at-comma"),
        ("accept_when: [min(x, max(x, 3), 4) > 2, x > 1]", "torn-at-comma"),
        ("accept_when:\n      - state: a", "torn-at-colon"),
        ("accept_when: [state: a]", "torn-at-colon"),
        ("accept_when: [x > 3 ? x : 5]", "torn-at-colon"),
        ("accept_when:\n      - state == # a", "cut-off-by-comment"),
        ('accept_when:\n      - state == "a # b"', "cut-off-by-comment"),
        ("accept_when: [x > 3 # 4]", "cut-off-by-comment"),
        ("accept_when:\n      - !known(x)", "read-as-tag"),
        ("accept_when: [!known(x)]", "read-as-tag"),
        ("accept_when:\n      - ! known(x)", "read-as-tag"),
        ("accept_when:\n      - > 3", "read-as-block"),
        ("accept_when:\n      - >= 3", "read-as-block"),
        ("accept_when:\n      - >3", "read-as-block"),
        ("accept_when: [> 3]", "read-as-block"),
        ("accept_when:\n      - | x", "read-as-block"),
        ("accept_when:\n      - 'a' == state", "read-as-quoted"),
        ('accept_when:\n      - "a" if x > 3 else "b"', "read-as-quoted"),
        ('accept_when: ["a" == state, x > 3]', "read-as-quoted"),
        ("accept_when:\n      - true", "read-as-literal"),
        ("accept_when: [x > 3, no, false]", "read-as-literal"),
        ("accept_when:\n      - 5", "read-as-literal"),
        ("accept_when:\n      - - x", "read-as-list"),
        ("accept_when:\n      - < 3", "condition-syntax"),
        ("accept_when:\n      - *x", "anchor"),
    ],
)
def test_every_trap_gives_one_finding_under_its_name(keys: str, rule: str) -> None:
    assert rules_of(f"{ALGORITHM}    {keys}\n") == [rule]


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("{near: min(x, 3) > 2, far: x > 3}", "torn-at-comma"),
        ('{near: state in ("a", "b"), far: x > 3}', "torn-at-comma"),
        ("{near: {enter: min(x, 3) > 2, leave: x < 1}}", "torn-at-comma"),
        ("{near: {open: x > min(1, 2), closed: x < 1}}", "torn-at-comma"),
        ("{near: > 3}", "read-as-block"),
        ('{near: "open" if x > 3 else "closed"}', "read-as-quoted"),
        ("{near: !known(x)}", "read-as-tag"),
        ("{near: true}", "read-as-literal"),
        ("{near: x: y}", "torn-at-colon"),
        ("{near: x > 3 # y}", "cut-off-by-comment"),
        ("\n      near: > 3", "read-as-block"),
        ("\n      near: x: y", "torn-at-colon"),
        ('\n      near: "open" if x > 3 else "closed"', "read-as-quoted"),
        ("\n      near: !known(x)", "read-as-tag"),
        ("\n      near: - x", "yaml-syntax"),
    ],
)
def test_traps_are_reported_in_identifies(text: str, rule: str) -> None:
    start = ALGORITHM.replace("    identifies: {near: x > 3}\n", "")

    assert rules_of(f"{start}    identifies: {text}\n") == [rule]


def test_after_traps_that_make_a_file_unreadable_the_rest_is_read() -> None:
    text = ALGORITHM + '    accept_when:\n      - > 3\n      - "a" == state\n    timeout: 5\nskils: {}\n'

    assert rules_of(text) == ["read-as-block", "read-as-quoted", "wrong-type", "unknown-key"]


def test_a_line_that_begins_with_a_minus_may_continue_a_difference() -> None:
    assert condition_of("    accept_when:\n      - x\n        - 1 > 2\n").text == "x - 1 > 2"


def test_names_are_parsed_once_and_mean_the_same() -> None:
    condition = condition_of("    accept_when: [state]\n")

    assert condition.tree == Name(start=0, end=5, name="state")


@pytest.mark.parametrize(
    ("items", "rule"),
    [
        ('[x becomes "a, b" within 5 s, y]', "torn-at-comma"),
        ("[x becomes < min(3, 4) within 5 s, y]", "torn-at-comma"),
        ("[x: becomes true]", "torn-at-colon"),
        ("\n      - x becomes: true", "torn-at-colon"),
        ("\n      - - x becomes true within 5 s", "read-as-list"),
        ("[!x]", "read-as-tag"),
        ("\n      - 'x' becomes true", "read-as-quoted"),
    ],
)
def test_traps_are_reported_in_monitor(items: str, rule: str) -> None:
    assert rules_of(f"codra: 1\nname: kitchen\nskills:\n  fill:\n    monitor: {items}\n") == [rule]
