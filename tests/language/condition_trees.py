"""Random syntax trees of conditions, without regard to types."""

from __future__ import annotations

from hypothesis import strategies as st

from codra_dsl.language.expression import (
    And,
    Arithmetic,
    Call,
    Choice,
    Compare,
    Comparison,
    In,
    Name,
    Negative,
    Node,
    Not,
    Number,
    Or,
    Text,
    Truth,
)

AT = {"start": 0, "end": 0}
NAMES = ("a", "b", "door_open", "s", "m", "h", "min_markers", "inside", "nota", "ifelse", "true_", "x1", "V")


def name(text: str) -> Name:
    return Name(name=text, **AT)


def number(value: float, unit: str | None = None) -> Number:
    return Number(value=value, unit=unit, **AT)


def compare(first: Node, *rest: tuple[str, Node]) -> Compare:
    return Compare(first=first, rest=tuple((Comparison(operator), node) for operator, node in rest), **AT)


def leaves() -> st.SearchStrategy[Node]:
    numbers = st.one_of(st.integers(0, 10**100), st.floats(0, 1e100, allow_nan=False))
    units = st.sampled_from([None, None, "m", "km/h", "1/s", "percent/min", "N*m", "min", "h"])
    return st.one_of(
        st.sampled_from(NAMES).map(name),
        st.builds(number, numbers, units),
        st.builds(Text, value=st.text(max_size=8), start=st.just(0), end=st.just(0)),
        st.builds(Truth, value=st.booleans(), start=st.just(0), end=st.just(0)),
        st.builds(
            lambda function, argument: Call(function=function, arguments=(name(argument),), **AT),
            st.sampled_from(["known", "age"]),
            st.sampled_from(NAMES),
        ),
    )


def branches(nodes: st.SearchStrategy[Node]) -> st.SearchStrategy[Node]:
    several = st.lists(nodes, min_size=2, max_size=3).map(tuple)
    link = st.tuples(st.sampled_from(Comparison), nodes)
    links = st.lists(link, min_size=1, max_size=3).map(tuple)
    return st.one_of(
        nodes.map(lambda node: Not(operand=node, **AT)),
        nodes.map(lambda node: Negative(operand=node, **AT)),
        several.map(lambda operands: And(operands=operands, **AT)),
        several.map(lambda operands: Or(operands=operands, **AT)),
        st.builds(lambda first, rest: Compare(first=first, rest=rest, **AT), nodes, links),
        st.builds(
            lambda item, options, no: In(item=item, options=options, negated=no, **AT), nodes, several, st.booleans()
        ),
        st.builds(
            lambda op, a, b: Arithmetic(operator=op, left=a, right=b, **AT), st.sampled_from("+-*/"), nodes, nodes
        ),
        st.builds(lambda a, b, c: Choice(then=a, condition=b, otherwise=c, **AT), nodes, nodes, nodes),
        nodes.map(lambda node: Call(function="abs", arguments=(node,), **AT)),
        several.map(lambda nodes: Call(function="max", arguments=nodes, **AT)),
    )


TREES = st.recursive(leaves(), branches, max_leaves=12)
