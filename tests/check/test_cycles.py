from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise, product
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.check import CheckedSpec
from codra_dsl.diagnostics import Diagnostic
from codra_dsl.expression import And, Call, Name, Node, Not, Or, names_in, to_text
from tests.check.specs import checked, marked, sound
from tests.check.typed_conditions import World, meaning

CASES = Path(__file__).parents[1] / "cases"
AT = {"start": 0, "end": 0}
VARIABLES = ("b1", "b2", "door", "side")


def loop(*algorithms: tuple[str, str, str], declared: Mapping[str, str] | None = None) -> str:
    """Return a spec with an algorithm for each (name, identified variable, keys of the algorithm)."""
    context = {variable: "valid_for: 10 s" for _, variable, _ in algorithms} | dict(declared or {})
    lines = ["codra: 1", "name: loop", "context:"]
    lines += [f"  {variable}: {{type: bool, {keys}}}" for variable, keys in context.items()]
    lines.append("perception:")
    for name, variable, keys in algorithms:
        lines += [f"  {name}:", "    call: loop.perception:see", "    returns: {seen: {type: bool}}"]
        lines += [f"    identifies: {{{variable}: seen}}", *(f"    {line}" for line in keys.splitlines())]
    return "\n".join(lines) + "\n"


def when(*conditions: str) -> str:
    return "\n".join(["observable_when:", *(f"  - {condition}" for condition in conditions)])


def only(text: str) -> Diagnostic:
    spec, found = checked(text)
    assert spec is None
    assert len(found) == 1, found
    return found[0]


def edges(text: str, found: Diagnostic) -> list[tuple[str, str]]:
    """Return what each edge of a cycle says, with the text that it points to."""
    lines = text.splitlines()
    spans = [each.place.span for each in found.related]
    shown = [lines[span.line - 1][span.column - 1 : span.end_column - 1] for span in spans]
    return [(each.message, text) for each, text in zip(found.related, shown, strict=True)]


def test_two_that_need_each_other_are_shown_with_both_edges() -> None:
    text = (CASES / "invalid/cycle-of-two.yaml").read_text("utf-8")
    found = only(text)
    assert found.message == "context-variables wait for each other: a -> b -> a"
    assert marked(text, found) == "b"
    assert edges(text, found) == [
        ("'a' needs 'b': algorithm 'see_a' runs when 'b'", "b"),
        ("'b' needs 'a': algorithm 'see_b' runs when 'a'", "a"),
    ]


def test_a_choice_of_two_that_both_lead_back_is_a_cycle() -> None:
    text = (CASES / "invalid/cycle-through-or.yaml").read_text("utf-8")
    found = only(text)
    assert found.message == "context-variables wait for each other: a -> b -> a"
    assert edges(text, found)[0] == ("'a' needs 'b': algorithm 'see_a' runs when 'b or c'", "b")


def test_what_does_not_wait_is_feedback() -> None:
    spec = sound((CASES / "valid/feedback.yaml").read_text("utf-8"))
    drawn = {name: (each.waits_for, each.feedback) for name, each in spec.algorithms.items()}
    assert drawn == {
        "see_a": ((), ("a", "b")),
        "see_b": (("a",), ()),
        "see_c": (("b",), ()),
        "guess_c": (("a",), ("c",)),
    }


def test_what_is_read_without_waiting_outside_of_any_cycle_is_drawn_as_required() -> None:
    spec = sound(loop(("see_a", "a", when("not known(b) or age(b) > 10 s")), ("see_b", "b", "")))
    assert (spec.algorithms["see_a"].waits_for, spec.algorithms["see_a"].feedback) == (("b",), ())


def test_what_waits_for_a_cycle_is_no_cause_of_its_own() -> None:
    text = loop(
        ("see_a", "a", when("b")),
        ("see_b", "b", when("a")),
        ("see_c", "c", when("a")),
        ("see_d", "d", when("c", "d or b")),
    )
    assert only(text).path == "context.a"


def test_two_cycles_that_do_not_need_each_other_are_two_causes() -> None:
    text = loop(
        ("see_a", "a", when("b")),
        ("see_b", "b", when("a")),
        ("see_c", "c", when("d")),
        ("see_d", "d", when("c", "a or c")),
    )
    assert [found.path for found in checked(text)[1]] == ["context.a", "context.c"]


def test_an_alternative_that_needs_nothing_breaks_a_cycle() -> None:
    sound(loop(("see_a", "a", when("b")), ("guess_a", "a", "rank: 2"), ("see_b", "b", when("a"))))


def test_another_source_breaks_a_cycle() -> None:
    algorithms = ("see_a", "a", when("b")), ("see_b", "b", when("a"))
    sound(loop(*algorithms, declared={"b": "valid_for: 10 s, source: [observer, main_execution]"}))


def test_a_given_value_is_waited_for() -> None:
    text = loop(("see_a", "a", "given: [b]"), ("see_b", "b", when("a")))
    assert edges(text, only(text))[0] == ("'a' needs 'b': algorithm 'see_a' is given its value", "b")


def test_the_shortest_of_several_cycles_is_shown() -> None:
    text = loop(
        ("see_a", "a", when("b")),
        ("see_b", "b", when("c")),
        ("see_c", "c", when("d and b")),
        ("see_d", "d", when("a")),
    )
    assert only(text).message == "context-variables wait for each other: b -> c -> b"


def test_a_variable_that_needs_itself_is_a_cycle_of_one() -> None:
    found = only(loop(("see_a", "a", when("a"))))
    assert found.message == "context-variable 'a' waits for itself: a -> a"
    assert found.help == "let it be identified without itself, e.g. when 'not known(a) or age(a) > 10 s'"


@pytest.mark.parametrize(
    ("conditions", "reason"),
    [
        (("b and not b",), "'b and not b' is never true"),
        (("b", "not b"), "'not b' is never true together with 'b'"),
        (
            ("known(b) == (age(b) < 0 s and false)", "known(b)"),
            "'known(b)' is never true together with 'known(b) == (age(b) < 0 s and false)'",
        ),
    ],
)
def test_conditions_that_exclude_each_other_are_no_cycle_but_never_run(
    conditions: tuple[str, ...], reason: str
) -> None:
    found = only(loop(("see_a", "a", when(*conditions)), ("see_b", "b", ""), ("see_c", "c", when("a"))))
    assert (found.rule.name, found.message) == ("never-runs", f"algorithm 'see_a' can never run: {reason}")


def test_a_condition_that_is_wrong_itself_is_not_said_to_close_a_cycle() -> None:
    text = loop(("see_a", "a", when("b > 3")), ("see_b", "b", when("a")))
    assert [found.rule.name for found in checked(text)[1]] == ["mismatched-types"]


def test_a_condition_that_reads_very_many_unknown_names_is_judged() -> None:
    many = [f"v{index}" for index in range(12)]
    algorithms = [(f"see_{name}", name, when("a")) for name in many]
    text = loop(("see_a", "a", when(" or ".join(many))), *algorithms)
    assert only(text).message == "context-variables wait for each other: a -> v0 -> a"


def test_a_long_chain_is_no_matter_of_recursion() -> None:
    chain = [(f"see_{index}", f"v{index}", when(f"v{index + 1}")) for index in range(1500)]
    sound(loop(*chain, ("see_end", "v1500", "")))
    assert only(loop(*chain, ("see_end", "v1500", when("v0")))).message.count("->") == 1501


def literals() -> st.SearchStrategy[Node]:
    def known(name: Node) -> Node:
        return Call(function="known", arguments=(name,), **AT)

    names = st.sampled_from(VARIABLES).map(lambda each: Name(name=each, **AT))
    asked = st.one_of(names, names, names.map(known))
    return st.one_of(asked, asked.map(lambda node: Not(operand=node, **AT)))


def conditions() -> st.SearchStrategy[Node]:
    def branches(nodes: st.SearchStrategy[Node]) -> st.SearchStrategy[Node]:
        several = st.lists(nodes, min_size=2, max_size=2).map(tuple)
        conjunctions = several.map(lambda operands: And(operands=operands, **AT))
        return st.one_of(conjunctions, several.map(lambda operands: Or(operands=operands, **AT)))

    return st.recursive(literals(), branches, max_leaves=4)


def can_run(needs: list[Node], reached: set[str]) -> bool:
    """Return whether conditions can hold, by trying every value of what is reached."""
    domains = [(True, False, None) if name in reached else (None,) for name in VARIABLES]
    worlds = (World(dict(zip(VARIABLES, values, strict=True)), {}) for values in product(*domains))
    return any(all(meaning(need, world) is True for need in needs) for world in worlds)


def least_fixed_point(algorithms: list[tuple[str, list[Node]]]) -> set[str]:
    reached: set[str] = set(VARIABLES) - {variable for variable, _ in algorithms}
    while new := {variable for variable, needs in algorithms if can_run(needs, reached)} - reached:
        reached |= new
    return reached


@settings(max_examples=150)
@given(st.lists(st.tuples(st.sampled_from(VARIABLES), st.lists(conditions(), max_size=2)), min_size=1, max_size=5))
def test_what_is_found_is_what_the_least_fixed_point_leaves_over(algorithms: list[tuple[str, list[Node]]]) -> None:
    outside = sorted(set(VARIABLES) - {variable for variable, _ in algorithms})
    text = loop(
        *(
            (f"see_{index}", variable, f"rank: {index + 1}\n" + (when(*map(to_text, needs)) if needs else ""))
            for index, (variable, needs) in enumerate(algorithms)
        ),
        declared=dict.fromkeys(outside, "valid_for: 5 s, source: main_execution"),
    )
    spec, found = checked(text)
    impossible = [needs for _, needs in algorithms if not can_run(needs, set(VARIABLES))]
    left_over = set(VARIABLES) - least_fixed_point(algorithms)
    assert (spec is None) == bool(left_over or impossible)
    assert len([each for each in found if each.rule.name == "never-runs"]) <= len(impossible)
    for each in found:
        if each.rule.name == "cycle":
            check_cycle(each, left_over, algorithms)


def check_cycle(found: Diagnostic, left_over: set[str], algorithms: list[tuple[str, list[Node]]]) -> None:
    """Require that a cycle goes through variables left over, each of which has an algorithm that reads the next."""
    path = found.message.partition(": ")[2].split(" -> ")
    assert path[0] == path[-1]
    assert set(path) <= left_over
    for variable, need in pairwise(path):
        reads = [
            name.name for each, needs in algorithms if each == variable for tree in needs for name in names_in(tree)
        ]
        assert need in reads


def test_cycles_are_the_same_whatever_the_order_of_algorithms() -> None:
    algorithms = [("see_a", "a", when("b or c")), ("see_b", "b", when("a")), ("see_c", "c", when("a"))]
    messages = {only(loop(*algorithms[turn:], *algorithms[:turn])).message for turn in range(3)}
    assert messages == {"context-variables wait for each other: a -> b -> a"}


def test_a_spec_with_feedback_keeps_what_it_needs() -> None:
    spec: CheckedSpec = sound((CASES / "valid/feedback.yaml").read_text("utf-8"))
    assert spec.algorithms["see_a"].needs == ("a", "b")
