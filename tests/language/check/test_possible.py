from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.language.check.conditions.types import Type
from codra_dsl.language.check.solver.satisfiable import can_hold, has_exact_answers, is_always_known
from codra_dsl.language.expression import (
    And,
    Call,
    Choice,
    Compare,
    Comparison,
    In,
    Name,
    Node,
    Not,
    Or,
    Text,
    Truth,
    parse,
)
from codra_dsl.language.model import Kind
from tests.language.check.typed_conditions import CONDITIONS, TYPES, TooCloseError, World, meaning, worlds

AT = {"start": 0, "end": 0}
SMALL = {
    "b1": Type(Kind.BOOL),
    "b2": Type(Kind.BOOL),
    "door": Type(Kind.ENUM, values=("open", "closed", "ajar")),
}


def name(text: str) -> Node:
    return Name(name=text, **AT)


def text(value: str) -> Node:
    return Text(value=value, **AT)


def atoms() -> st.SearchStrategy[Node]:
    operators = st.sampled_from([Comparison.EQUAL, Comparison.NOT_EQUAL])
    members = st.sampled_from(["open", "closed", "ajar"]).map(text)
    option_lists = st.lists(members, min_size=1, max_size=2).map(tuple)
    return st.one_of(
        st.sampled_from(["b1", "b2"]).map(name),
        st.sampled_from(sorted(SMALL)).map(lambda variable: Call(function="known", arguments=(name(variable),), **AT)),
        st.booleans().map(lambda value: Truth(value=value, **AT)),
        st.builds(lambda op, member: Compare(first=name("door"), rest=((op, member),), **AT), operators, members),
        st.builds(
            lambda options, no: In(item=name("door"), options=options, negated=no, **AT), option_lists, st.booleans()
        ),
    )


def branches(nodes: st.SearchStrategy[Node]) -> st.SearchStrategy[Node]:
    operand_lists = st.lists(nodes, min_size=2, max_size=3).map(tuple)
    return st.one_of(
        nodes.map(lambda node: Not(operand=node, **AT)),
        operand_lists.map(lambda operands: And(operands=operands, **AT)),
        operand_lists.map(lambda operands: Or(operands=operands, **AT)),
        st.builds(lambda a, b, c: Choice(then=a, condition=b, otherwise=c, **AT), nodes, nodes, nodes),
        st.builds(lambda a, b: Compare(first=a, rest=((Comparison.EQUAL, b),), **AT), nodes, nodes),
    )


LOGIC = st.recursive(atoms(), branches, max_leaves=6)


def all_worlds(unknown: frozenset[str]) -> Iterator[World]:
    domains = {
        variable: (True, False, None) if kind.kind is Kind.BOOL else (*kind.values, None)
        for variable, kind in SMALL.items()
    }
    domains |= dict.fromkeys(unknown, (None,))
    for values in product(*domains.values()):
        yield World(dict(zip(domains, values, strict=True)), dict.fromkeys(SMALL, 1.0))


@settings(max_examples=75)
@given(st.lists(LOGIC, min_size=1, max_size=3), st.sets(st.sampled_from(sorted(SMALL))))
def test_for_bools_and_enums_can_hold_agrees_with_trying_everything(conditions: list[Node], unknown: set[str]) -> None:
    unknown_names = frozenset(unknown)
    expected = any(
        all(meaning(condition, world) is True for condition in conditions) for world in all_worlds(unknown_names)
    )
    assert can_hold(conditions, unknown_names, SMALL) is expected


@settings(max_examples=75)
@given(LOGIC, st.sets(st.sampled_from(sorted(SMALL))))
def test_for_bools_and_enums_always_known_agrees_with_trying_everything(value: Node, unknown: set[str]) -> None:
    expected = all(
        meaning(value, world) is not None
        for world in all_worlds(frozenset())
        if {variable for variable, content in world.values.items() if content is None} <= unknown
    )
    assert is_always_known(value, unknown, SMALL) is expected


@settings(max_examples=50)
@given(CONDITIONS, worlds())
def test_a_value_that_is_unknown_in_some_world_is_not_always_known(tree: Node, world: World) -> None:
    unknown = [variable for variable, content in world.values.items() if content is None]
    try:
        result = meaning(tree, world)
    except TooCloseError:
        result = True
    if result is None:
        assert not is_always_known(tree, unknown, TYPES)


@settings(max_examples=50)
@given(CONDITIONS, worlds())
def test_a_condition_that_holds_in_some_world_can_hold(tree: Node, world: World) -> None:
    unknown = [variable for variable, value in world.values.items() if value is None]
    try:
        held = meaning(tree, world)
    except TooCloseError:
        held = None
    if held is True:
        assert can_hold([tree], unknown, TYPES)


NUMBERS = {"r": Type(Kind.FLOAT, range=(0.0, 4.0)), "n": Type(Kind.INT, range=(0.0, 4.0)), "b1": Type(Kind.BOOL)}
COMPARISONS = st.builds(
    "{} {} {}".format,
    st.sampled_from(["r", "n", "(r if r > 2 else 0)"]),
    st.sampled_from(["<", "<=", ">", ">=", "==", "!="]),
    st.integers(-1, 5),
)
LINEAR = st.recursive(
    st.one_of(COMPARISONS, st.sampled_from(["b1", "r in (1, 3)", "0 < n < 3", "known(r)"])),
    lambda conditions: st.one_of(
        conditions.map("not ({})".format),
        st.builds("({}) and ({})".format, conditions, conditions),
        st.builds("({}) or ({})".format, conditions, conditions),
    ),
    max_leaves=4,
)


@settings(max_examples=100)
@given(st.lists(LINEAR, min_size=1, max_size=3))
def test_for_linear_comparisons_of_one_name_can_hold_is_exact(texts: list[str]) -> None:
    trees = [tree for tree in map(parse, texts) if isinstance(tree, Node)]
    quarters, whole_numbers = (None, *(quarter / 4 for quarter in range(17))), (None, *range(5))
    some_worlds = (
        World({"r": r, "n": n, "b1": b1}, dict.fromkeys(NUMBERS, 1.0))
        for r, n, b1 in product(quarters, whole_numbers, (None, True, False))
    )
    expected = any(all(meaning(tree, world) is True for tree in trees) for world in some_worlds)
    assert all(map(has_exact_answers, trees))
    assert can_hold(trees, (), NUMBERS) is expected


@pytest.mark.parametrize("condition", ["r > x", "r * r > 3", "1 / r > 3", "b1 and x + r > 3"])
def test_a_comparison_of_two_names_or_one_that_is_curved_is_not_exact(condition: str) -> None:
    tree = parse(condition)
    assert isinstance(tree, Node)
    assert not has_exact_answers(tree)


def is_possible(condition: str, *unknown: str) -> bool:
    tree = parse(condition)
    assert isinstance(tree, Node)
    return can_hold([tree], unknown, TYPES)


@pytest.mark.parametrize(
    ("condition", "unknown", "expected"),
    [
        ("b1 or b2", ("b1",), True),
        ("b1 or b2", ("b1", "b2"), False),
        ("not known(x) or age(x) > 10 s", ("x",), True),
        ("age(x) > 10 s", ("x",), False),
        ("known(x)", ("x",), False),
        ("x > 3 m", ("x",), False),
        ("x > 3 m or b1", ("x",), True),
        ("door == 'open' or door == 'closed'", ("door",), False),
        ("door == 'open' and door == 'closed'", (), False),
        ("door in ('open', 'closed') and door != 'open'", (), True),
        ("b1 and not b1", (), False),
        ("b1 and (not b1 or b2)", ("b2",), False),
        ("max(x, 1 m) > 0", ("x",), False),
        ("n / r > 1", (), True),
        ("b1 if known(x) else b2", ("x", "b1"), True),
        ("b1 if known(x) else b2", ("x", "b2"), False),
        ("false", (), False),
        ("x > 3 m and x < 2 m", (), False),
        ("n - r > 5 and n - r < 3", (), False),
        ("n - r > 5 and r < n - 7", (), True),
        ("n - r > 5 and r > n - 5", (), False),
        ("2 * x - y < 1 m and y < 2 * (x - 1 m)", (), False),
        ("n * r > 5 and r * n < 3", (), False),
        ("n / r > 5 and n / r < 3", (), False),
        ("r * r > 5 and r * r < 3", (), False),
        ("abs(n - r) < 2 and abs(r - n) > 3", (), False),
        ("max(n, r) < 2 and max(r, n) > 3", (), False),
        ("n - n > 0", (), False),
        ("n / 0 > 1", (), False),
    ],
)
def test_conditions_can_hold_or_not_while_some_names_are_unknown(
    condition: str, unknown: tuple[str, ...], expected: bool
) -> None:
    assert is_possible(condition, *unknown) is expected


def test_very_many_combinations_are_not_all_tried() -> None:
    types = {f"b{index}": Type(Kind.BOOL) for index in range(20)}
    tree = parse(" and ".join(f"{variable} and ({variable} or known({variable}))" for variable in types))
    assert isinstance(tree, Node)
    assert can_hold([tree], (), types)
