from __future__ import annotations

import pytest
from hypothesis import given, settings

from codra_dsl.language.check import RULES
from codra_dsl.language.check.conditions.fitting import fit
from codra_dsl.language.check.conditions.lowering import to_python
from codra_dsl.language.check.conditions.types import Type, infer, infer_condition
from codra_dsl.language.expression import Node, names_in, parse
from codra_dsl.language.model import Kind
from codra_dsl.language.units import UNITS
from tests.language.check.typed_conditions import CONDITIONS, TYPES
from tests.language.condition_trees import NAMES, TREES

SEEN: dict[str, Type | None] = dict(zip(NAMES, [*TYPES.values(), None], strict=True))


def tree(text: str) -> Node:
    parsed_tree = parse(text)
    assert isinstance(parsed_tree, Node), parsed_tree
    return parsed_tree


@settings(max_examples=75)
@given(TREES)
def test_every_parsed_condition_is_checked_and_sound_ones_can_be_lowered(node: Node) -> None:
    for reads_context in (True, False):
        typed, problems = infer_condition(node, SEEN, reads_context=reads_context)
        assert all(problem.rule in RULES and problem.message and problem.help for problem in problems)
        if not problems and all(SEEN[name.name] is not None for name in names_in(node)):
            compile(to_python(typed), "condition", "eval")


@given(CONDITIONS)
def test_a_name_with_a_wrong_declaration_causes_no_problem(node: Node) -> None:
    assert infer_condition(node, dict.fromkeys(TYPES), reads_context=True)[1] == ()


@pytest.mark.parametrize(
    ("text", "kind", "unit"),
    [
        ("n + 1", Kind.INT, "1"),
        ("n + 0.5", Kind.FLOAT, "1"),
        ("n * 2", Kind.INT, "1"),
        ("n / 2", Kind.FLOAT, "1"),
        ("y + y", Kind.INT, "mm"),
        ("y + 1 cm", Kind.FLOAT, "mm"),
        ("1 cm + y", Kind.FLOAT, "mm"),
        ("0 + x", Kind.FLOAT, "m"),
        ("max(y, 0)", Kind.INT, "mm"),
        ("x / t", Kind.FLOAT, "m/s"),
        ("x / y", Kind.FLOAT, "1"),
        ("-y", Kind.INT, "mm"),
        ("abs(d)", Kind.FLOAT, "deg"),
        ("y if b1 else 0", Kind.INT, "mm"),
    ],
)
def test_numbers_have_a_type_and_a_unit(text: str, kind: Kind, unit: str) -> None:
    typed, problems = infer(tree(text), TYPES, reads_context=True)
    assert problems == ()
    assert typed.type is not None
    assert (typed.type.kind, str(typed.type.unit)) == (kind, unit)


@pytest.mark.parametrize(
    ("text", "wanted", "fits"),
    [
        ("b1", Type(Kind.BOOL), True),
        ("n", Type(Kind.BOOL), False),
        ("n", Type(Kind.FLOAT), True),
        ("r", Type(Kind.INT), False),
        ("0", Type(Kind.FLOAT, UNITS["m"]), True),
        ("0", Type(Kind.INT, UNITS["m"]), True),
        ("1", Type(Kind.FLOAT, UNITS["m"]), False),
        ("y", Type(Kind.FLOAT, UNITS["cm"]), True),
        ("y", Type(Kind.INT, UNITS["mm"]), True),
        ("y", Type(Kind.INT, UNITS["cm"]), False),
        ("x", Type(Kind.FLOAT, UNITS["s"]), False),
        ("x", Type(Kind.FLOAT), False),
        ("label", Type(Kind.STR), True),
        ("door", Type(Kind.STR), True),
        ("label", Type(Kind.ENUM, values=("x",)), False),
        ("'x' if b1 else 'y'", Type(Kind.ENUM, values=("x", "y")), True),
        ("'x' if b1 else 'z'", Type(Kind.ENUM, values=("x", "y")), False),
        ("side", Type(Kind.ENUM, values=("open", "shut", "gone")), True),
        ("door", Type(Kind.ENUM, values=("open", "shut", "gone")), False),
        ("b1", Type(Kind.STR), False),
    ],
)
def test_a_value_fits_a_variable_or_not(text: str, wanted: Type, fits: bool) -> None:
    typed, problems = infer(tree(text), TYPES, reads_context=True)
    assert problems == ()
    assert (not list(fit(typed, wanted, "variable", may_map=True))) is fits


def test_every_wrong_part_of_a_condition_is_a_separate_problem() -> None:
    _, problems = infer_condition(tree("n > 3 m and (x < 2 or label) and door == 'opne'"), TYPES, reads_context=True)
    assert [(problem.rule, problem.node.start) for problem in problems] == [
        ("missing-unit", 0),
        ("missing-unit", 17),
        ("not-a-condition", 22),
        ("unknown-member", 41),
    ]
