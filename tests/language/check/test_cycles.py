from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise, product
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.language.check import CheckedSpec
from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.language.expression import And, Call, Name, Node, Not, Or, names_in, to_text
from tests.language.check.specs import check_sound_text, check_text, marked_text
from tests.language.check.typed_conditions import World, meaning

CASES = Path(__file__).parents[2] / "cases"
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


def observable_when_text(*conditions: str) -> str:
    return "\n".join(["observable_when:", *(f"  - {condition}" for condition in conditions)])


def only_finding(text: str) -> Diagnostic:
    spec, diagnostics = check_text(text)
    assert spec is None
    assert len(diagnostics) == 1, diagnostics
    return diagnostics[0]


def edges(text: str, finding: Diagnostic) -> list[tuple[str, str]]:
    """Return the message of each edge of a cycle, with the text that it points to."""
    lines = text.splitlines()
    spans = [related.place.span for related in finding.related]
    marked_texts = [lines[span.line - 1][span.column - 1 : span.end_column - 1] for span in spans]
    return [(related.message, cause_text) for related, cause_text in zip(finding.related, marked_texts, strict=True)]


def test_a_cycle_of_two_variables_is_reported_with_both_edges() -> None:
    text = (CASES / "invalid/cycle-of-two.yaml").read_text("utf-8")
    finding = only_finding(text)
    assert finding.message == "context-variables wait for each other: a -> b -> a"
    assert marked_text(text, finding) == "b"
    assert edges(text, finding) == [
        ("'a' needs 'b': algorithm 'see_a' runs when 'b'", "b"),
        ("'b' needs 'a': algorithm 'see_b' runs when 'a'", "a"),
    ]


def test_a_choice_between_two_variables_that_both_lead_back_is_a_cycle() -> None:
    text = (CASES / "invalid/cycle-through-or.yaml").read_text("utf-8")
    finding = only_finding(text)
    assert finding.message == "context-variables wait for each other: a -> b -> a"
    assert edges(text, finding)[0] == ("'a' needs 'b': algorithm 'see_a' runs when 'b or c'", "b")


def test_variables_that_are_read_without_waiting_are_feedback() -> None:
    spec = check_sound_text((CASES / "valid/feedback.yaml").read_text("utf-8"))
    needs_by_algorithm = {
        name: (algorithm.waits_for, algorithm.feedback) for name, algorithm in spec.algorithms.items()
    }
    assert needs_by_algorithm == {
        "see_a": ((), ("a", "b")),
        "see_b": (("a",), ()),
        "see_c": (("b",), ()),
        "guess_c": (("a",), ("c",)),
    }


def test_variables_read_without_waiting_outside_of_cycles_are_required() -> None:
    spec = check_sound_text(
        loop(("see_a", "a", observable_when_text("not known(b) or age(b) > 10 s")), ("see_b", "b", ""))
    )
    assert (spec.algorithms["see_a"].waits_for, spec.algorithms["see_a"].feedback) == (("b",), ())


def test_variables_that_wait_for_a_cycle_are_not_reported() -> None:
    text = loop(
        ("see_a", "a", observable_when_text("b")),
        ("see_b", "b", observable_when_text("a")),
        ("see_c", "c", observable_when_text("a")),
        ("see_d", "d", observable_when_text("c", "d or b")),
    )
    assert only_finding(text).path == "context.a"


def test_two_independent_cycles_are_two_findings() -> None:
    text = loop(
        ("see_a", "a", observable_when_text("b")),
        ("see_b", "b", observable_when_text("a")),
        ("see_c", "c", observable_when_text("d")),
        ("see_d", "d", observable_when_text("c", "a or c")),
    )
    assert [finding.path for finding in check_text(text)[1]] == ["context.a", "context.c"]


def test_an_alternative_without_needs_breaks_a_cycle() -> None:
    check_sound_text(
        loop(
            ("see_a", "a", observable_when_text("b")),
            ("guess_a", "a", "rank: 2"),
            ("see_b", "b", observable_when_text("a")),
        )
    )


def test_another_source_breaks_a_cycle() -> None:
    algorithms = ("see_a", "a", observable_when_text("b")), ("see_b", "b", observable_when_text("a"))
    check_sound_text(loop(*algorithms, declared={"b": "valid_for: 10 s, source: [observer, main_execution]"}))


def test_a_given_value_is_waited_for() -> None:
    text = loop(("see_a", "a", "given: [b]"), ("see_b", "b", observable_when_text("a")))
    assert edges(text, only_finding(text))[0] == ("'a' needs 'b': algorithm 'see_a' gets its value with 'given'", "b")


def test_the_shortest_of_several_cycles_is_shown() -> None:
    text = loop(
        ("see_a", "a", observable_when_text("b")),
        ("see_b", "b", observable_when_text("c")),
        ("see_c", "c", observable_when_text("d and b")),
        ("see_d", "d", observable_when_text("a")),
    )
    assert only_finding(text).message == "context-variables wait for each other: b -> c -> b"


def test_a_variable_that_needs_itself_is_a_cycle_of_one() -> None:
    finding = only_finding(loop(("see_a", "a", observable_when_text("a"))))
    assert finding.message == "context-variable 'a' waits for itself: a -> a"
    assert finding.help == (
        "identify it with an algorithm that does not wait for it, e.g. with the condition "
        "'not known(a) or age(a) > 10 s'"
    )


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
def test_contradictory_conditions_are_reported_as_never_run_and_not_as_a_cycle(
    conditions: tuple[str, ...], reason: str
) -> None:
    finding = only_finding(
        loop(
            ("see_a", "a", observable_when_text(*conditions)),
            ("see_b", "b", ""),
            ("see_c", "c", observable_when_text("a")),
        )
    )
    assert (finding.rule.name, finding.message) == ("never-runs", f"algorithm 'see_a' can never run: {reason}")


def test_a_wrong_condition_is_not_reported_as_part_of_a_cycle() -> None:
    text = loop(("see_a", "a", observable_when_text("b > 3")), ("see_b", "b", observable_when_text("a")))
    assert [finding.rule.name for finding in check_text(text)[1]] == ["mismatched-types"]


def test_a_condition_with_very_many_unknown_names_is_checked() -> None:
    names = [f"v{index}" for index in range(12)]
    algorithms = [(f"see_{name}", name, observable_when_text("a")) for name in names]
    text = loop(("see_a", "a", observable_when_text(" or ".join(names))), *algorithms)
    assert only_finding(text).message == "context-variables wait for each other: a -> v0 -> a"


def test_a_long_chain_causes_no_recursion_error() -> None:
    chain = [(f"see_{index}", f"v{index}", observable_when_text(f"v{index + 1}")) for index in range(1500)]
    check_sound_text(loop(*chain, ("see_end", "v1500", "")))
    assert only_finding(loop(*chain, ("see_end", "v1500", observable_when_text("v0")))).message.count("->") == 1501


def literals() -> st.SearchStrategy[Node]:
    def known_call(name: Node) -> Node:
        return Call(function="known", arguments=(name,), **AT)

    names = st.sampled_from(VARIABLES).map(lambda variable: Name(name=variable, **AT))
    operands = st.one_of(names, names, names.map(known_call))
    return st.one_of(operands, operands.map(lambda node: Not(operand=node, **AT)))


def conditions() -> st.SearchStrategy[Node]:
    def branches(nodes: st.SearchStrategy[Node]) -> st.SearchStrategy[Node]:
        operand_pairs = st.lists(nodes, min_size=2, max_size=2).map(tuple)
        conjunctions = operand_pairs.map(lambda operands: And(operands=operands, **AT))
        return st.one_of(conjunctions, operand_pairs.map(lambda operands: Or(operands=operands, **AT)))

    return st.recursive(literals(), branches, max_leaves=4)


def can_run(needs: list[Node], reached_variables: set[str]) -> bool:
    """Return whether conditions can hold, by trying every value of the reached variables."""
    domains = [(True, False, None) if name in reached_variables else (None,) for name in VARIABLES]
    worlds = (World(dict(zip(VARIABLES, values, strict=True)), {}) for values in product(*domains))
    return any(all(meaning(need, world) is True for need in needs) for world in worlds)


def least_fixed_point(algorithms: list[tuple[str, list[Node]]]) -> set[str]:
    reached_variables: set[str] = set(VARIABLES) - {variable for variable, _ in algorithms}
    while (
        new_variables := {variable for variable, needs in algorithms if can_run(needs, reached_variables)}
        - reached_variables
    ):
        reached_variables |= new_variables
    return reached_variables


@settings(max_examples=50)
@given(st.lists(st.tuples(st.sampled_from(VARIABLES), st.lists(conditions(), max_size=2)), min_size=1, max_size=5))
def test_cycles_are_reported_exactly_for_variables_outside_the_least_fixed_point(
    algorithms: list[tuple[str, list[Node]]],
) -> None:
    source_variables = sorted(set(VARIABLES) - {variable for variable, _ in algorithms})
    text = loop(
        *(
            (
                f"see_{index}",
                variable,
                f"rank: {index + 1}\n" + (observable_when_text(*map(to_text, needs)) if needs else ""),
            )
            for index, (variable, needs) in enumerate(algorithms)
        ),
        declared=dict.fromkeys(source_variables, "valid_for: 5 s, source: main_execution"),
    )
    spec, diagnostics = check_text(text)
    impossible_needs = [needs for _, needs in algorithms if not can_run(needs, set(VARIABLES))]
    remaining_variables = set(VARIABLES) - least_fixed_point(algorithms)
    assert (spec is None) == bool(remaining_variables or impossible_needs)
    assert len([finding for finding in diagnostics if finding.rule.name == "never-runs"]) <= len(impossible_needs)
    for finding in diagnostics:
        if finding.rule.name == "cycle":
            check_cycle(finding, remaining_variables, algorithms)


def check_cycle(finding: Diagnostic, remaining_variables: set[str], algorithms: list[tuple[str, list[Node]]]) -> None:
    """Assert that a cycle consists of remaining variables, each with an algorithm that reads the next one."""
    path = finding.message.partition(": ")[2].split(" -> ")
    assert path[0] == path[-1]
    assert set(path) <= remaining_variables
    for variable, need in pairwise(path):
        reads = [
            name.name
            for algorithm, needs in algorithms
            if algorithm == variable
            for tree in needs
            for name in names_in(tree)
        ]
        assert need in reads


def test_cycles_do_not_depend_on_the_order_of_algorithms() -> None:
    algorithms = [
        ("see_a", "a", observable_when_text("b or c")),
        ("see_b", "b", observable_when_text("a")),
        ("see_c", "c", observable_when_text("a")),
    ]
    messages = {only_finding(loop(*algorithms[turn:], *algorithms[:turn])).message for turn in range(3)}
    assert messages == {"context-variables wait for each other: a -> b -> a"}


def test_a_spec_with_feedback_keeps_what_it_needs() -> None:
    spec: CheckedSpec = check_sound_text((CASES / "valid/feedback.yaml").read_text("utf-8"))
    assert spec.algorithms["see_a"].needs == ("a", "b")
