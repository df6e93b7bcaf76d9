from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import product

from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl import logic
from codra_dsl.language.check import implies
from codra_dsl.language.check.conditions.lowering import to_python
from codra_dsl.language.check.conditions.types import Type, infer_condition
from codra_dsl.language.check.solver.satisfiable import always_holds, can_hold
from codra_dsl.language.expression import Arithmetic, Comparison, In, Negative, Node
from codra_dsl.language.model import Kind
from codra_dsl.language.units import UNITS
from codra_dsl.logic import Term, Value
from tests.language.check.typed_conditions import AT, World, call, compare, composite_conditions, name, number

STEPS = 16
TYPES = {
    "b": Type(Kind.BOOL),
    "n": Type(Kind.INT, UNITS["cm"], range=(-2, 3)),
    "x": Type(Kind.FLOAT, UNITS["m"], range=(0, 2)),
}
"""Types small enough to try every relevant value: all cuts are multiples of 1 / STEPS."""
ORDERED = [Comparison.LESS, Comparison.LESS_OR_EQUAL, Comparison.GREATER, Comparison.GREATER_OR_EQUAL]

Trees = st.SearchStrategy[Node]


def constants(variable: str) -> Trees:
    lengths = [number(quarter / 4, "m") for quarter in range(10)] + [number(50, "cm"), number(1500, "mm"), number(0)]
    counts = [number(quarter / 2, "cm") for quarter in range(8)] + [number(10, "mm"), number(0)]
    return st.sampled_from(counts if variable == "n" else lengths)


def quantities(variable: str) -> Trees:
    return st.recursive(st.just(name(variable)), partial(_expressions, variable), max_leaves=2)


def _expressions(variable: str, values: Trees) -> Trees:
    constant_values = constants(variable)
    return st.one_of(
        st.builds(
            lambda op, a, b: Arithmetic(operator=op, left=a, right=b, **AT),
            st.sampled_from("+-"),
            values,
            constant_values,
        ),
        st.builds(lambda a: Arithmetic(operator="*", left=number(2), right=a, **AT), values),
        values.map(lambda operand: Negative(operand=operand, **AT)),
        values.map(lambda operand: call("abs", operand)),
        st.builds(call, st.sampled_from(["min", "max"]), values, constant_values),
    )


def atoms() -> Trees:
    comparisons = [
        st.builds(
            lambda a, op, c: compare(a, (op, c)), quantities(variable), st.sampled_from(Comparison), constants(variable)
        )
        for variable in ("n", "x")
    ]
    chains = [
        st.builds(
            lambda low, a, op, high: compare(low, (Comparison.LESS, a), (op, high)),
            constants(variable),
            quantities(variable),
            st.sampled_from(ORDERED),
            constants(variable),
        )
        for variable in ("n", "x")
    ]
    option_lists = st.lists(constants("n"), min_size=1, max_size=3).map(tuple)
    memberships = st.builds(
        lambda options, no: In(item=name("n"), options=options, negated=no, **AT), option_lists, st.booleans()
    )
    plain_conditions = st.sampled_from([name("b"), *(call("known", name(variable)) for variable in TYPES)])
    return st.one_of(plain_conditions, memberships, *comparisons, *chains)


CONDITIONS: Trees = st.recursive(atoms(), composite_conditions, max_leaves=5)


def term(condition: Node) -> Term:
    typed, problems = infer_condition(condition, TYPES, reads_context=True)
    assert problems == ()
    built_term = eval(to_python(typed), vars(logic).copy())
    assert isinstance(built_term, Term)
    return built_term


def all_worlds(*, with_unknown: bool) -> Iterator[World]:
    unknown: list[Value | None] = [None] if with_unknown else []
    domains = {
        "b": [*unknown, True, False],
        "n": [*unknown, *range(-2, 4)],
        "x": [*unknown, *(step / STEPS for step in range(2 * STEPS + 1))],
    }
    for values in product(*domains.values()):
        yield World(dict(zip(domains, values, strict=True)), dict.fromkeys(TYPES, 1.0))


def hold(conditions: Sequence[Term], world: World) -> bool:
    return all(condition.evaluate(world) is True for condition in conditions)


@settings(max_examples=50)
@given(st.lists(CONDITIONS, min_size=1, max_size=3))
def test_conditions_over_numbers_can_hold_exactly_if_some_values_make_them_true(conditions: list[Node]) -> None:
    terms = [term(condition) for condition in conditions]
    expected = any(hold(terms, world) for world in all_worlds(with_unknown=True))
    assert can_hold(conditions, (), TYPES) is expected


@settings(max_examples=50)
@given(CONDITIONS, CONDITIONS)
def test_a_condition_follows_from_another_exactly_if_no_values_make_only_the_other_true(one: Node, other: Node) -> None:
    stronger, weaker = term(one), term(other)
    expected = all(hold([weaker], world) for world in all_worlds(with_unknown=True) if hold([stronger], world))
    assert implies([one], [other], TYPES) is expected


def asks_for_knowledge(condition: Node) -> bool:
    return "known(" in repr(term(condition))


@settings(max_examples=50)
@given(CONDITIONS.filter(lambda condition: not asks_for_knowledge(condition)))
def test_a_condition_always_holds_exactly_if_all_known_values_make_it_true(condition: Node) -> None:
    judged_term = term(condition)
    expected = all(hold([judged_term], world) for world in all_worlds(with_unknown=False))
    assert always_holds(condition, TYPES) is expected
