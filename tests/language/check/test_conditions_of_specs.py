"""CDR5102, CDR7105 and CDR7106: conditions that never hold, or always hold."""

from __future__ import annotations

import pytest

from tests.language.check.specs import findings, marked_text

SPEC = """\
codra: 1
name: gripper
context:
  gripper: {type: enum, values: [open, closed, stuck], source: main_execution, valid_for: 10 s}
  distance: {type: float, unit: m, range: [0, 20], source: main_execution, valid_for: 10 s}
  height: {type: float, unit: cm, source: main_execution, valid_for: 10 s}
  level: {type: float, unit: percent, range: [0, 100], source: main_execution, valid_for: 10 s}
  steps: {type: int, range: [1, 9], source: main_execution, valid_for: 10 s}
  place: {type: str, source: main_execution, valid_for: 10 s}
  lit: {type: bool, source: main_execution, valid_for: 10 s}
  held: {type: bool}
  drawer: {type: enum, values: [closed, ajar, open]}
  count: {type: int}
perception:
  look:
    call: gripper.perception:look
    given: [GIVEN]
    returns:
      gap: {type: float, unit: m, range: [0, 1]}
      angle: {type: float, unit: rad, range: [0, 2], optional: true}
      markers: {type: int, range: [0, 12]}
      seen: {type: bool}
      handle: {type: enum, values: [up, level]}
    observable_when: OBSERVABLE
    accept_when: ACCEPT
    identifies:
      held: HELD
      drawer: DRAWER
      count: markers
"""
MEMBERS = "{closed: gap < 1 cm, ajar: gap < 20 cm, open: 'true'}"


def list_text(conditions: tuple[str, ...]) -> str:
    return "[" + ", ".join(f"'{condition}'" for condition in conditions) + "]"


def findings_with_related(
    *observable: str, accept: tuple[str, ...] = (), held: str = "seen", drawer: str = MEMBERS, given: str = ""
) -> list[tuple[str, str, list[str]]]:
    """Return the rule, the marked text without quotes and the related messages of each finding about the spec."""
    text = SPEC.replace("[GIVEN]", f"[{given}]").replace("OBSERVABLE", list_text(observable))
    text = text.replace("ACCEPT", list_text(accept)).replace("HELD", held).replace("DRAWER", drawer)
    return [
        (finding.rule.name, marked_text(text, finding).strip("'"), [finding.message for finding in finding.related])
        for finding in findings(text)
    ]


TOGETHER = "cannot be true together with this"


@pytest.mark.parametrize(
    ("conditions", "offender", "related"),
    [
        (('gripper == "open"', 'gripper == "closed"'), 'gripper == "closed"', [TOGETHER]),
        (("distance < 1 m", "lit", "distance > 200 cm"), "distance > 200 cm", [TOGETHER]),
        (("distance > 2 m and lit", "distance < 1 m or not lit"), "distance < 1 m or not lit", [TOGETHER, TOGETHER]),
        (("height > 1 m", "height < 1 cm"), "height < 1 cm", [TOGETHER]),
        (("level > 120 percent",), "level > 120 percent", ["'level' is between 0 and 100 percent"]),
        (("level < 0 percent or level > 100 percent",), "level < 0 percent or level > 100 percent", None),
        (("3 < steps < 4",), "3 < steps < 4", []),
        (("steps == 2.5",), "steps == 2.5", []),
        (("steps in (1, 2)", "steps not in (1, 2, 3)"), "steps not in (1, 2, 3)", [TOGETHER]),
        (("steps + 1 <= 1",), "steps + 1 <= 1", ["'steps' is between 1 and 9"]),
        (("abs(height) < 10 cm", "height > 0.2 m"), "height > 0.2 m", [TOGETHER]),
        (("2 * distance - 1 m > 39 m",), "2 * distance - 1 m > 39 m", ["'distance' is between 0 and 20 m"]),
        (('place == "hall" and place == "cellar"',), 'place == "hall" and place == "cellar"', []),
        (("not (lit or not lit)",), "not (lit or not lit)", []),
        (("known(lit)", "not known(lit)"), "not known(lit)", [TOGETHER]),
        (("age(lit) > 8 s", "age(lit) < 3 s"), "age(lit) < 3 s", [TOGETHER]),
        (("age(lit) > 11 s",), "age(lit) > 11 s", ["'lit' is valid for 10 s"]),
        (("not known(lit) and lit",), "not known(lit) and lit", []),
        (("distance < height", "height < distance"), "height < distance", [TOGETHER]),
        (("distance > height", "height > 21 m"), "height > 21 m", [TOGETHER, "'distance' is between 0 and 20 m"]),
        (("(1 if lit else 2) > 2",), "(1 if lit else 2) > 2", []),
        (("false",), "false", []),
    ],
)
def test_conditions_that_are_never_true_together_are_reported_at_their_place(
    conditions: tuple[str, ...], offender: str, related: list[str] | None
) -> None:
    (finding,) = findings_with_related(*conditions)
    assert finding[:2] == ("never-runs", offender)
    assert related is None or finding[2] == related


def test_a_value_that_is_given_is_known() -> None:
    assert findings_with_related("not known(lit)", given="lit") == [("never-runs", "not known(lit)", [TOGETHER])]
    assert findings_with_related("not known(lit) or distance > 3 m", given="lit") == []


@pytest.mark.parametrize(
    "conditions",
    [
        ('gripper != "open"', 'gripper != "closed"'),
        ("distance < 2 m", "distance >= 199.9 cm"),
        ("distance <= 1 m", "distance >= 100 cm"),
        ("level >= 100 percent",),
        ("2 < steps < 4",),
        ("2 <= steps < 2.5",),
        ("steps in (1, 2)", "steps not in (2, 3)"),
        ("distance < 1 m or distance > 2 m", "distance > 1.5 m"),
        ("abs(height) > 10 cm", "height < 0 cm"),
        ('place != "hall"', 'place != "cellar"'),
        ("height / 2 m > 3", "height < 0 m or lit"),
        ("height * height < 0", "lit"),
        ("age(lit) > 9 s",),
        ("not known(lit) or age(lit) > 8 s", "known(lit)"),
        ("known(lit)", "lit or not known(place)"),
        ("distance <= height", "height <= distance"),
        ("lit or not lit and known(place)",),
    ],
)
def test_conditions_that_can_be_true_together_are_no_finding(conditions: tuple[str, ...]) -> None:
    assert findings_with_related(*conditions) == []


@pytest.mark.parametrize(
    ("accept", "offender"),
    [
        (("markers >= 2", "seen", "markers < 2"), "markers < 2"),
        (("markers > 12",), "markers > 12"),
        (('handle == "up" and handle == "level"',), 'handle == "up" and handle == "level"'),
        (("gap < 1 cm", "gap > 10 mm"), "gap > 10 mm"),
    ],
)
def test_an_algorithm_that_rejects_all_results_is_reported_once(accept: tuple[str, ...], offender: str) -> None:
    assert [finding[:2] for finding in findings_with_related(accept=accept, held="gap > 2 m")] == [
        ("never-holds", offender)
    ]


@pytest.mark.parametrize(
    ("held", "accept", "offender", "related"),
    [
        ("gap > 120 cm", (), "gap > 120 cm", ["'gap' is between 0 and 1 m"]),
        ("markers < 2", ("markers >= 2",), "markers < 2", [TOGETHER]),
        ("seen and gap > 0.5 m", ("gap < 40 cm",), "gap > 0.5 m", [TOGETHER]),
        ("{enter: markers > 20}", (), "markers > 20", ["'markers' is between 0 and 12"]),
        ("angle < 0 rad", (), "angle < 0 rad", ["'angle' is between 0 and 2 rad"]),
    ],
)
def test_a_bool_that_never_becomes_true_is_reported(
    held: str, accept: tuple[str, ...], offender: str, related: list[str]
) -> None:
    assert findings_with_related(held=held, accept=accept) == [("never-holds", offender, related)]


@pytest.mark.parametrize("held", ["gap > 0.5 m", "'true'", "'false'", "seen and gap > 0.5 m", "angle > 1.9 rad"])
def test_a_bool_that_can_become_true_or_is_a_literal_is_no_finding(held: str) -> None:
    assert findings_with_related(held=held, accept=("gap < 80 cm",)) == []


@pytest.mark.parametrize(
    ("drawer", "offender", "related"),
    [
        ("{open: gap >= 0 m, ajar: gap < 20 cm}", "gap < 20 cm", ["holds first in these cases"]),
        (
            "{open: gap < 1 m, ajar: gap < 20 cm, closed: gap < 1 cm}",
            "gap < 20 cm",
            ["holds first in these cases", "'drawer' is never 'closed' either"],
        ),
        (
            "{open: gap < 0.5 m, ajar: gap > 0.4 m, closed: gap > 0.3 m}",
            "gap > 0.3 m",
            ["holds first in these cases", "holds first in these cases"],
        ),
        ("{open: gap > 2 m, ajar: gap < 20 cm}", "gap > 2 m", ["'gap' is between 0 and 1 m"]),
        ("{open: seen, ajar: 'seen and handle == \"up\"'}", 'seen and handle == "up"', ["holds first in these cases"]),
    ],
)
def test_a_member_that_is_never_first_is_reported_with_those_above_it(
    drawer: str, offender: str, related: list[str]
) -> None:
    assert findings_with_related(drawer=drawer) == [("never-holds", offender, related)]


def test_accept_when_counts_for_members() -> None:
    drawer = "{closed: gap < 1 cm, open: gap >= 1 cm}"
    assert findings_with_related(drawer=drawer) == []
    assert [finding[:2] for finding in findings_with_related(drawer=drawer, accept=("gap > 2 cm",))] == [
        ("never-holds", "gap < 1 cm")
    ]


def test_a_member_with_an_absent_value_is_not_skipped() -> None:
    assert findings_with_related(drawer="{closed: angle >= 0 rad, open: seen}") == [
        ("never-holds", "seen", ["holds first in these cases"])
    ]


@pytest.mark.parametrize(
    ("condition", "offender"),
    [
        ("distance >= 0 m", "distance >= 0 m"),
        ("distance <= 2000 cm", "distance <= 2000 cm"),
        ('gripper in ("open", "closed", "stuck")', 'gripper in ("open", "closed", "stuck")'),
        ("lit or not lit", "lit or not lit"),
        ("lit and steps > 0.5", "steps > 0.5"),
        ("height < 1 m or height > 10 cm", "height < 1 m or height > 10 cm"),
        ("abs(height) >= 0", "abs(height) >= 0"),
        ("steps != 0", "steps != 0"),
        ("0 <= level <= 100 percent", "0 <= level <= 100 percent"),
        ("known(lit) or not known(lit)", "known(lit) or not known(lit)"),
        ("distance >= 0 m or age(lit) < 3 s", "distance >= 0 m or age(lit) < 3 s"),
        ("true", "true"),
    ],
)
def test_a_precondition_that_always_holds_is_reported(condition: str, offender: str) -> None:
    assert [finding[:2] for finding in findings_with_related(condition)] == [("always-holds", offender)]


@pytest.mark.parametrize(
    "condition",
    [
        "lit",
        "not lit",
        "known(lit)",
        "age(lit) >= 0 s",
        "known(lit) or age(lit) > 3 s",
        "distance > 0 m",
        "distance < 20 m",
        "height >= 0 m",
        'gripper in ("open", "closed")',
        "lit or steps > 1",
        "steps > 1",
        "distance / height > 0 or distance / height <= 0",
    ],
)
def test_a_precondition_that_can_be_false_is_no_finding(condition: str) -> None:
    assert findings_with_related(condition) == []


@pytest.mark.parametrize(
    ("accept", "held", "offenders"),
    [
        (("markers >= 0", "seen"), "seen", ["markers >= 0"]),
        ((), "markers < 13", ["markers < 13"]),
        ((), "{enter: gap <= 1 m, leave: gap < 0.2 m}", ["gap <= 1 m"]),
        (("markers >= 1",), "markers >= 1", []),
        (("markers >= 0 or seen",), "seen or not seen", ["markers >= 0 or seen", "seen or not seen"]),
        (("angle >= 0 rad",), "angle >= 0 rad", []),
    ],
)
def test_a_condition_over_results_that_always_holds_is_reported_unless_a_value_may_be_absent(
    accept: tuple[str, ...], held: str, offenders: list[str]
) -> None:
    marked_texts = [text for rule, text, _ in findings_with_related(accept=accept, held=held)]
    assert marked_texts == offenders


def test_a_name_with_a_wrong_declaration_causes_no_finding_about_conditions() -> None:
    text = SPEC.replace("[GIVEN]", "[]").replace("OBSERVABLE", "[level > 200 percent]").replace("ACCEPT", "[]")
    text = text.replace("HELD", "seen").replace("DRAWER", MEMBERS)
    wrong_text = text.replace("steps: {type: int, range: [1, 9]", "steps: {type: int, range: [1, 9.5]")
    assert [finding.rule.name for finding in findings(wrong_text)] == ["wrong-range", "never-runs"]


def test_an_algorithm_with_an_error_hides_no_condition_of_the_next_one() -> None:
    unsound = """\
  first:
    call: gripper.perception:first
    returns: {seen: {type: bool}}
    observable_when: [unheard_of]
    identifies: {held: seen}
    rank: 9
"""
    text = SPEC.replace("[GIVEN]", "[]").replace("OBSERVABLE", "['steps != 0']").replace("ACCEPT", "[]")
    text = text.replace("HELD", "seen").replace("DRAWER", MEMBERS)
    text = text.replace("perception:\n", f"perception:\n{unsound}")

    assert {"unknown-variable", "always-holds"} <= {finding.rule.name for finding in findings(text)}
