"""Changes beyond the edits of `edits.yaml`: further keys, names in the package, and whole specs."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from codra_dsl.compiler import plan_text
from codra_dsl.generation.emit import emit
from codra_dsl.language.diagnostics import Diagnostic, Place, Rule, Severity, Span, has_errors
from codra_dsl.tooling.diff import BrokenSpec, Category, Level, Review, Verdict, Version, review
from codra_dsl.tooling.diff.variables import names_by_enum_type
from codra_dsl.tooling.diff.version import Side
from tests.tooling.diff.versions import plan_version, review_edits

ROOT = Path(__file__).parents[3]
BASE = """\
codra: 1
name: oven
context:
  hot: {type: bool}
  heat: {type: float, unit: percent, range: [0, 100]}
  mode: {type: enum, values: [off, grill, bake], valid_for: 1 min}
  wish: {type: enum, values: [off, grill, bake], source: main_execution}
  lid: {type: bool, source: main_execution, valid_for: 5 s}
  crust: {type: int, range: [0, 9]}
resources:
  camera: {}
  probe: {}
  arm: {slots: 2}
perception:
  feel:
    call: oven.hands:feel
    with: {depth: 2 cm}
    uses: {probe: read, arm: slot}
    min_interval: 1 s
    returns:
      warmth: {type: float, unit: percent, range: [0, 100]}
      pain: {type: float, optional: true}
    observable_when:
      - lid
    identifies:
      hot: {enter: warmth > 60 percent, leave: warmth < 40 percent, confirm: 2 of 3}
      heat: warmth
  watch:
    call: oven.eyes:watch
    uses: {camera: read}
    given: [lid]
    rank: 2
    returns:
      dial: {type: enum, values: [off, grill, bake]}
    identifies:
      mode: dial
  guess:
    call: oven.eyes:guess
    uses: {camera: read}
    rank: 3
    returns:
      sound: {type: str}
    identifies:
      mode:
        off: sound == "none"
        grill: sound == "fan"
        bake: sound not in ("none", "fan")
  smell:
    call: oven.nose:smell
    returns:
      burnt: {type: int, range: [0, 9]}
    observable_when:
      - mode in ("grill", "bake")
    identifies:
      crust: burnt
skills:
  bake:
    preview: [hot, mode, wish, crust]
    monitor: [heat becomes > 80 percent within 5 min, mode stays "bake"]
observers:
  oven_heat: {identifies: [hot, heat], period: 2 s}
"""


def change_texts(diff_review: Review) -> list[str]:
    return sorted(f"{change.category} {change.element}" for change in diff_review.changes)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("call: oven.hands:feel", "call: oven.hands:touch", ["perceived-otherwise oven/perception/feel"]),
        ("depth: 2 cm", "depth: deep", ["contract oven/perception/feel"]),
        ("depth: 2 cm", "length: 2 cm", ["contract oven/perception/feel"]),
        ("pain: {type: float, optional: true}", "pain: {type: float}", ["contract oven/perception/feel"]),
        (
            "    uses: {probe: read, arm: slot}\n",
            "    uses: {probe: read, arm: slot}\n    isolate: process\n",
            ["perceived-otherwise oven/perception/feel"],
        ),
        ("      pain: {type: float, optional: true}\n", "", ["contract oven/perception/feel"]),
        (
            "warmth: {type: float, unit: percent, range: [0, 100]}",
            "warmth: {type: float, unit: percent, range: [0, 120]}",
            ["eased oven/perception/feel"],
        ),
        (
            "sound: {type: str}",
            "sound: {type: str}\n      light: {type: bool, optional: true}",
            ["eased oven/perception/guess"],
        ),
        ("confirm: 2 of 3", "confirm: 1 of 3", ["weaker oven/perception/feel"]),
        ("confirm: 2 of 3", "confirm: 3 of 3", ["stronger oven/perception/feel"]),
        ("confirm: 2 of 3", "confirm: 2 of 5", ["weaker oven/perception/feel"]),
        ("confirm: 2 of 3", "confirm: 2 of 2", ["stronger oven/perception/feel"]),
        ("confirm: 2 of 3", "confirm: 3 of 5", ["guard-changed oven/perception/feel"]),
        (", confirm: 2 of 3", "", ["weaker oven/perception/feel"]),
        ("leave: warmth < 40 percent", "leave: warmth < 50 percent", ["redefined oven/perception/feel"]),
        ('off: sound == "none"', 'off: sound == "quiet"', ["redefined oven/perception/guess"]),
        ('bake: sound not in ("none", "fan")', 'bake: sound != "none" and sound != "fan"', []),
        ("min_interval: 1 s", "min_interval: 2 s", ["slower oven/perception/feel"]),
        ("min_interval: 1 s", "min_interval: 0 s", ["faster oven/perception/feel"]),
        ("    given: [lid]\n", "", ["weaker oven/perception/watch", "contract oven/perception/watch"]),
        ("    given: [lid]\n", "    observable_when:\n      - known(lid)\n", ["contract oven/perception/watch"]),
        ("    rank: 3\n", "    rank: 1\n", ["perceived-otherwise oven/context/mode", "renamed oven/observer/guess"]),
        ("hot: {type: bool}", "hot: {type: bool, history: 10}", ["stronger oven/context/hot"]),
        ("hot: {type: bool}", "hot: {type: bool, when_unobservable: forget}", ["stronger oven/context/hot"]),
        ("hot: {type: bool}", "hot: {type: bool, refresh: on_event}", ["slower oven/context/hot"]),
        ("hot: {type: bool}", "hot: {type: bool, of: kitchen}", ["layout oven/context/hot"]),
        ("hot: {type: bool}", "hot: {type: bool, description: It burns.}", ["wording oven/context/hot"]),
        ("range: [0, 9]}\nresources", "range: [0, 9], unit: percent}\nresources", None),
        ("arm: {slots: 2}", "arm: {slots: 1}", []),
        ("within 5 min", "within 4 min", ["stronger oven/skill/bake"]),
        ("heat becomes > 80 percent", "heat becomes >= 80 percent", ["weaker oven/skill/bake"]),
        ('mode stays "bake"', 'mode stays "grill"', ["guard-changed oven/skill/bake"]),
        ("  oven_heat: {", "  oven_warmth: {", ["renamed oven/observer/oven_warmth"]),
        ("name: oven", "name: stove", ["added stove", "removed oven"]),
        ("  smell:\n", "  sniff:\n", ["renamed oven/perception/sniff"]),
        ("  bake:\n    preview", "  roast:\n    preview", ["added oven/skill/roast", "removed oven/skill/bake"]),
        ('mode in ("grill", "bake")', 'mode != "off"', []),
    ],
)
def test_a_change_of_a_key_has_the_category_of_its_effect_on_a_robot(
    old: str, new: str, expected: list[str] | None
) -> None:
    if expected is None:  # its identification has no unit, so there is no plan of B
        assert has_errors(plan_text(BASE.replace(old, new), "oven.yaml", ROOT / "tests").diagnostics)
    else:
        assert change_texts(review_edits(BASE, (old, new))) == sorted(expected)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("hot, hot or lid", "hot or lid", ["weaker oven/skill/bake"]),
        ("hot or lid", "hot, hot or lid", ["stronger oven/skill/bake"]),
        ("hot and lid, hot", "hot and lid", []),
    ],
)
def test_a_preview_that_no_longer_needs_a_variable_to_be_known_holds_more_often(
    old: str, new: str, expected: list[str]
) -> None:
    before = BASE.replace("preview: [hot,", f"preview: [{old},")
    assert change_texts(review_edits(before, (f"preview: [{old},", f"preview: [{new},"))) == expected


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        (
            "within 5 min",
            "within 4 min",
            "an expectation holds less often: was 'heat becomes > 80 percent within 300 s', "
            "is 'heat becomes > 80 percent within 240 s'",
        ),
        (
            'mode stays "bake"',
            'mode stays "grill"',
            "an expectation holds in other situations: was 'mode stays \"bake\"', is 'mode stays \"grill\"'",
        ),
        (', mode stays "bake"', ", mode", "'mode stays \"bake\"' is no longer expected"),
    ],
)
def test_a_changed_expectation_is_shown_as_a_spec_states_it(old: str, new: str, text: str) -> None:
    (change,) = review_edits(BASE, (old, new)).changes
    assert change.text == text


def test_a_renamed_algorithm_does_not_rename_its_observer_as_well() -> None:
    """The name of the observer follows from that of the algorithm."""
    result = review_edits(BASE, ("  watch:\n", "  look:\n"))

    assert change_texts(result) == ["renamed oven/perception/look"]


def test_guards_are_compared_with_those_of_replaced_algorithms() -> None:
    other = ("  smell:\n    call: oven.nose:smell\n", "  taste:\n    call: oven.mouth:taste\n")
    guard = ('mode in ("grill", "bake")', "known(mode)")

    replaced = ["perceived-otherwise oven/context/crust", "renamed oven/observer/taste"]
    assert change_texts(review_edits(BASE, other)) == replaced
    assert change_texts(review_edits(BASE, other, guard)) == [*replaced, "weaker oven/perception/taste"]


def test_a_new_first_alternative_changes_what_is_perceived() -> None:
    new = (
        "  ask:\n    call: oven.radio:ask\n    returns:\n"
        "      dial: {type: enum, values: [off, grill, bake]}\n    identifies:\n      mode: dial\n"
    )

    assert "perceived-otherwise oven/context/mode" in change_texts(
        review_edits(BASE, ("  smell:\n", f"{new}  smell:\n"))
    )


def test_a_lost_name_of_an_enum_in_the_package_is_reported() -> None:
    head, rest = (
        "  mode: {type: enum, values: [off, grill, bake], valid_for: 1 min}\n",
        "  wish: {type: enum, values: [off, grill, bake], source: main_execution}\n",
    )

    assert change_texts(review_edits(BASE, (head + rest, rest + head))) == ["api oven/context/mode"]


@pytest.mark.parametrize("name", ["lab", "kitchen"])
def test_the_names_of_enums_are_those_of_the_generated_package(name: str) -> None:
    planned_spec = plan_text((ROOT / f"specs/{name}.yaml").read_text("utf-8"), f"specs/{name}.yaml", ROOT).plans[0]
    (entry,) = (text for path, text in emit(planned_spec).items() if path == f"{name}/__init__.py")
    bound = {
        target.id
        for node in ast.parse(entry).body
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name)
    }

    assert set(names_by_enum_type(Side(plan=planned_spec))) <= bound
    assert (name == "kitchen") is bool(names_by_enum_type(Side(plan=planned_spec)))


def test_a_spec_under_a_new_name_is_recognised_in_the_message() -> None:
    result = review(plan_version(BASE), plan_version(BASE.replace("name: oven", "name: ovens")))

    (removed,) = (change for change in result.changes if change.category is Category.REMOVED)
    assert "'ovens' looks like its new name" in removed.message


def test_a_renamed_variable_is_recognised_by_its_algorithm() -> None:
    result = review_edits(
        BASE,
        ("  crust: {", "  browning: {"),
        ("      crust: burnt", "      browning: burnt"),
        ("wish, crust]", "wish, browning]"),
    )

    (removed,) = (change for change in result.changes if change.category is Category.REMOVED)
    assert "'browning' looks like its new name" in removed.message
    assert change_texts(result) == ["added oven/context/browning", "removed oven/context/crust"]


def test_the_verdict_is_that_of_the_worst_change_and_every_category_has_a_level() -> None:
    assert {category.level for category in Category} == set(Level)
    assert review(plan_version(BASE), plan_version(BASE)).verdict is Verdict.SAME
    assert review(Version(), plan_version(BASE)).verdict is Verdict.COMPATIBLE
    assert review(plan_version(BASE), Version()).verdict is Verdict.BREAKING


def test_a_reversed_comparison_has_the_opposite_categories() -> None:
    """Weaker becomes stronger, slower becomes faster, and every change is reported both ways."""
    opposite = {"weaker": "stronger", "slower": "faster", "added": "removed", "widened": "narrowed"}
    opposite |= {other: one for one, other in opposite.items()}
    edits = [
        (
            "lid: {type: bool, source: main_execution, valid_for: 5 s}",
            "lid: {type: bool, source: main_execution, valid_for: 9 s}",
        )
    ]
    edits += [("period: 2 s", "period: 3 s"), ("range: [0, 9]}\nresources", "range: [0, 12]}\nresources")]
    text = BASE
    for old, new in edits:
        text = text.replace(old, new)

    forth, back = review(plan_version(BASE), plan_version(text)), review(plan_version(text), plan_version(BASE))

    assert sorted(opposite[change.category] + change.element for change in forth.changes) == sorted(
        change.category + change.element for change in back.changes
    )


def broken_spec(name: str | None, code: str = "CDR4101") -> BrokenSpec:
    rule = Rule(code=code, name="x", severity=Severity.ERROR)
    place = Place(Span("spec.yaml", 3, 1, 3, 2))
    error = Diagnostic(rule=rule, message="wrong", place=place, path="perception.feel.accept_when", help="x")
    return BrokenSpec(name=name, file="spec.yaml", errors=(error,))


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        (plan_version(BASE), Version(broken_specs=(broken_spec("oven"),)), ["invalid oven/perception/feel"]),
        (plan_version(BASE), Version(broken_specs=(broken_spec("oven", "CDR5101"),)), ["cyclic oven/perception/feel"]),
        (
            plan_version(BASE),
            Version(broken_specs=(broken_spec("oven", "CDR5102"),)),
            ["unobservable oven/perception/feel"],
        ),
        (plan_version(BASE), Version(broken_specs=(broken_spec(None),)), ["invalid spec.yaml/perception/feel"]),
        (
            plan_version(BASE),
            Version(broken_specs=(broken_spec("pan"),)),
            ["invalid pan/perception/feel", "removed oven"],
        ),
        (Version(broken_specs=(broken_spec("oven"),)), plan_version(BASE), ["repaired oven"]),
        (Version(broken_specs=(broken_spec(None),)), plan_version(BASE), ["repaired oven"]),
        (
            Version(broken_specs=(broken_spec("oven"),)),
            Version(broken_specs=(broken_spec("oven"),)),
            ["invalid oven/perception/feel"],
        ),
        (Version(broken_specs=(broken_spec("oven"),)), Version(), ["removed oven"]),
        (
            plan_version(BASE),
            Version(plans=plan_version(BASE).plans, broken_specs=(broken_spec("oven"),)),
            ["invalid oven/perception/feel"],
        ),
        (Version(plans=plan_version(BASE).plans, broken_specs=(broken_spec("oven"),)), plan_version(BASE), []),
    ],
)
def test_the_errors_of_a_spec_are_reported_once(before: Version, after: Version, expected: list[str]) -> None:
    assert change_texts(review(before, after)) == expected
