"""Type inference for conditions: the type of each part, or the reason why the part has no type."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field, replace
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise
from typing import Any

from codra_dsl.language.diagnostics import suggest
from codra_dsl.language.expression import (
    And,
    Arithmetic,
    Call,
    Choice,
    Compare,
    Comparison,
    Fallback,
    In,
    Name,
    Negative,
    Node,
    Not,
    Number,
    Or,
    Text,
    Truth,
    written_text,
)
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model import FOREVER_S, Kind, ValueType
from codra_dsl.language.units import ONE, UNITS, Unit, parse_unit

NUMERIC = frozenset({Kind.INT, Kind.FLOAT})
_MAX_EXPONENT = 9
_MAX_FACTOR = Fraction(10) ** 60
_EQUALITY_OPERATORS = ("==", "!=")


@dataclass(frozen=True, slots=True)
class Type:
    """The type of an expression.

    Attributes:
        unit: the unit of a number. If another unit is requested, the number is converted.
        values: the members of an enum.
        is_literal: whether the expression consists of literals only. A literal text that is a member fits an enum.
        is_zero: whether the expression is the literal 0, which needs no unit.
        range: the range of a name, in `unit`, with both ends included; None if no range is declared.
        valid_for_s: for a context-variable, the maximum age of its evidence while the variable is known.
    """

    kind: Kind
    unit: Unit = ONE
    values: tuple[str, ...] = ()
    is_literal: bool = False
    is_zero: bool = False
    range: tuple[float, float] | None = field(default=None, compare=False)
    valid_for_s: float = field(default=FOREVER_S, compare=False)

    @property
    def is_number(self) -> bool:
        """Whether the expression is a number."""
        return self.kind in NUMERIC

    def __str__(self) -> str:
        """Return the type as text for messages, e.g. `a float in m`."""
        noun = f"an {self.kind}" if self.kind in (Kind.INT, Kind.ENUM) else f"a {self.kind}"
        return noun if self.unit == ONE else f"{noun} in {self.unit}"


Types = Mapping[str, Type | None]
"""The type of each readable name; None if the declaration of the name is wrong. Such errors have been reported."""

BOOL = Type(Kind.BOOL)
_SECONDS = Type(Kind.FLOAT, UNITS["s"])


@dataclass(frozen=True, slots=True)
class Typed:
    """A part of a condition with its type and its own parts. The type is None if a problem inside has been reported."""

    node: Node
    type: Type | None
    parts: tuple[Typed, ...] = ()


@dataclass(frozen=True, slots=True)
class Problem:
    """A type error in a part of a condition.

    Attributes:
        rule: the name of a rule of `check`.
        suggestion: for a quoted text that is not a member, the most similar of the `candidates`; None if no candidate
            is similar.
    """

    rule: str
    node: Node
    message: str
    help: str
    suggestion: str | None = None
    candidates: tuple[str, ...] = ()


def declared_type(declared: ValueType, valid_for_s: float = FOREVER_S) -> Type | None:
    """Return the declared type, or None if the declaration is invalid. Equal declarations give the same object."""
    # the ends are separate arguments, since the cache must distinguish a range with 0 from a range with 0.0
    low, high = declared.range if declared.range is not None else (None, None)
    return _declared_type(
        kind=declared.kind, unit_text=declared.unit, low=low, high=high, values=declared.values, valid_for_s=valid_for_s
    )


@lru_cache(maxsize=4096, typed=True)
def _declared_type(
    *,
    kind: Kind,
    unit_text: str | None,
    low: float | None,
    high: float | None,
    values: tuple[str, ...],
    valid_for_s: float,
) -> Type | None:
    unit = ONE if unit_text is None else parse_unit(unit_text)
    if unit is None or (kind is Kind.ENUM and not values):
        return None
    if kind not in NUMERIC:
        return Type(kind, values=values if kind is Kind.ENUM else (), valid_for_s=valid_for_s)
    bounds = None if low is None or high is None else (low, high)
    return Type(kind, unit, range=bounds, valid_for_s=valid_for_s)


def infer(node: Node, types: Types, *, reads_context: bool) -> tuple[Typed, tuple[Problem, ...]]:
    """Return the types of a value's parts, and the problems in them.

    Args:
        node: the syntax tree of the value. Names that are missing in `types` have been reported already.
        types: the type of each name.
        reads_context: whether the value reads context-variables. Only then, `known` and `age` are allowed.
    """
    inference = _Inference(types, reads_context)
    typed = inference.infer(node)
    return typed, tuple(inference.problems)


def infer_condition(node: Node, types: Types, *, reads_context: bool) -> tuple[Typed, tuple[Problem, ...]]:
    """Return the types of a condition's parts, and the problems in them. The arguments are those of `infer`."""
    inference = _Inference(types, reads_context)
    typed = inference.condition(node)
    return typed, tuple(inference.problems)


def unknown_member_problems(value: Typed, wanted_type: Type, owner: str) -> list[Problem]:
    """Return the problems of the literal texts in a value that are not members of an enum of `owner`."""
    inference = _Inference({}, reads_context=False)
    inference.check_members(value, wanted_type, owner)
    return inference.problems


def comparisons(given: Type) -> str:
    """Return operators that compare values of a type, for messages."""
    return "'==' or '<'" if given.is_number else "'=='"


class _Inference:
    """Infers the types in a condition in one walk, from the leaves up."""

    def __init__(self, types: Types, reads_context: bool) -> None:
        self._types = types
        self._reads_context = reads_context
        self.problems: list[Problem] = []

    def infer(self, node: Node) -> Typed:
        """Return a node with its type."""
        return _INFERENCE_METHODS[type(node)](self, node)

    def check_members(self, value: Typed, wanted_type: Type, owner: str) -> None:
        """Report each quoted text in a value that is not a member of the owner's enum."""
        if isinstance(value.node, Choice | Fallback):
            self.check_members(value.parts[0], wanted_type, owner)
            self.check_members(value.parts[-1], wanted_type, owner)
        elif isinstance(value.node, Text) and value.node.value not in wanted_type.values:
            nearest_member = suggest(value.node.value, wanted_type.values)
            member_texts = ", ".join(f'"{member}"' for member in wanted_type.values[:10])
            help = f'did you mean "{nearest_member}"?' if nearest_member else f"members are {member_texts}"
            message = f'"{value.node.value}" is not a value of {owner}'
            self.problems.append(
                Problem("unknown-member", value.node, message, help, nearest_member, wanted_type.values)
            )

    def _report(self, rule: str, at: Typed, message: str, help: str) -> None:
        self.problems.append(Problem(rule, at.node, message, help))

    def _name(self, node: Name) -> Typed:
        return Typed(node, self._types.get(node.name))

    def _number(self, node: Number) -> Typed:
        unit = ONE if node.unit is None else parse_unit(node.unit)
        if unit is None:
            return Typed(node, None)
        kind = Kind.INT if isinstance(node.value, int) else Kind.FLOAT
        return Typed(node, Type(kind, unit, is_literal=True, is_zero=node.value == 0 and node.unit is None))

    def _text(self, node: Text) -> Typed:
        return Typed(node, Type(Kind.STR, is_literal=True))

    def _truth(self, node: Truth) -> Typed:
        return Typed(node, Type(Kind.BOOL, is_literal=True))

    def condition(self, node: Node, before: Node | None = None) -> Typed:
        """Return a part with its type, and report the part if it is not a condition.

        `before` is the previous operand of the same `and` or `or`.
        """
        typed = self.infer(node)
        if typed.type is None or typed.type.kind is Kind.BOOL:
            return typed
        if isinstance(typed.node, Text) and typed.node.value in self._types:
            help = "write the name without quotes"
        elif typed.type.is_literal and isinstance(before, Compare):
            compared_text, operator = written_text(before.first), before.rest[0][0]
            help = f"repeat the left side: {compared_text} {operator} {written_text(typed.node)}"
        else:
            help = f"compare it, e.g. with {comparisons(typed.type)}"
        node_text = written_text(typed.node)
        self._report("not-a-condition", typed, f"{node_text} is {typed.type}, not true or false", help)
        return typed

    def _not(self, node: Not) -> Typed:
        return Typed(node, BOOL, (self.condition(node.operand),))

    def _and_or(self, node: And | Or) -> Typed:
        operands_with_previous = zip(node.operands, (None, *node.operands), strict=False)
        return Typed(node, BOOL, tuple(self.condition(operand, before) for operand, before in operands_with_previous))

    def _quantity(self, node: Node) -> Typed:
        """Return a part with its type, and report the part if it is not a number."""
        typed = self.infer(node)
        if typed.type is None or typed.type.is_number:
            return typed
        node_text = written_text(typed.node)
        self._report(
            "wrong-operand", typed, f"{node_text} is {typed.type}, not a number", "calculate with numbers only"
        )
        return replace(typed, type=None)

    def _negative(self, node: Negative) -> Typed:
        operand = self._quantity(node.operand)
        return Typed(node, operand.type, (operand,))

    def _arithmetic(self, node: Arithmetic) -> Typed:
        left, right = self._quantity(node.left), self._quantity(node.right)
        if left.type is None or right.type is None:
            return Typed(node, None, (left, right))
        if node.operator in "+-":
            return Typed(node, self._common_type((left, right)), (left, right))
        return Typed(node, self._product(node, left.type, right.type), (left, right))

    def _product(self, node: Arithmetic, left: Type, right: Type) -> Type | None:
        if node.operator == "/" and isinstance(node.right, Number) and node.right.value == 0:
            message = f"{written_text(node)} has no value, because it divides by 0"
            self.problems.append(Problem("wrong-operand", node, message, "divide by another number"))
            return None
        unit = left.unit / right.unit if node.operator == "/" else left.unit * right.unit
        has_large_exponent = any(abs(exponent) > _MAX_EXPONENT for exponent in unit.dimension.exponents)
        if has_large_exponent or not 1 / _MAX_FACTOR < unit.factor < _MAX_FACTOR:
            problem = Problem("wrong-operand", node, "the unit of the result is out of bounds", "simplify it")
            self.problems.append(problem)
            return None
        is_int = node.operator == "*" and left.kind is right.kind is Kind.INT
        return Type(Kind.INT if is_int else Kind.FLOAT, unit, is_literal=left.is_literal and right.is_literal)

    def _common_type(self, values: tuple[Typed, ...]) -> Type | None:
        """Return the common type of the operands of a sum, a choice or a function; None if their types do not match."""
        for left, right in pairwise(values):
            if not self._are_compatible(left, right):
                return None
        types = [value.type for value in values if value.type is not None]
        if len(types) < len(values) or not types[0].is_number:
            return self._joined_type(types) if len(types) == len(values) else None
        nonzero_types = [type_ for type_ in types if not type_.is_zero] or types
        reference_type = next((type_ for type_ in nonzero_types if not type_.is_literal), nonzero_types[0])
        is_int = all(type_.kind is Kind.INT and (type_.is_zero or type_.unit == reference_type.unit) for type_ in types)
        is_literal = all(type_.is_literal for type_ in types)
        return Type(
            Kind.INT if is_int else Kind.FLOAT,
            reference_type.unit,
            is_literal=is_literal,
            is_zero=all(type_.is_zero for type_ in types),
        )

    def _joined_type(self, types: list[Type]) -> Type:
        """Return the type of a choice between values that are not numbers."""
        is_literal = all(type_.is_literal for type_ in types)
        enums = [type_ for type_ in types if type_.kind is Kind.ENUM]
        if not enums:
            return replace(types[0], is_literal=is_literal)
        if any(type_.kind is Kind.STR and not type_.is_literal for type_ in types):
            return Type(Kind.STR)
        return Type(Kind.ENUM, values=tuple(dict.fromkeys(member for enum in enums for member in enum.values)))

    def _are_compatible(self, left: Typed, right: Typed) -> bool:
        """Return whether two values can be added or compared; report the reason if they cannot."""
        if left.type is None or right.type is None:
            return False
        if left.type.is_number and right.type.is_number:
            problem = None if left.type.is_zero or right.type.is_zero else _unit_problem(left, right)
            self.problems += [problem] if problem else []
            return problem is None
        texts = {Kind.STR, Kind.ENUM}
        if left.type.kind in texts and right.type.kind in texts:
            return self._are_texts_compatible(left, right)
        if left.type.kind is right.type.kind:
            return True
        message = f"{written_text(left.node)} is {left.type}, but {written_text(right.node)} is {right.type}"
        self._report("mismatched-types", right, message, _mismatch_help(left, right))
        return False

    def _are_texts_compatible(self, left: Typed, right: Typed) -> bool:
        before = len(self.problems)
        for value, other in ((left, right), (right, left)):
            if value.type and other.type and other.type.kind is Kind.ENUM and value.type.kind is Kind.STR:
                self.check_members(value, other.type, written_text(other.node))
        enums = [side.type.values for side in (left, right) if side.type and side.type.kind is Kind.ENUM]
        if len(enums) == 2 and not set(enums[0]) & set(enums[1]):
            message = f"{written_text(left.node)} and {written_text(right.node)} have no value in common"
            self._report("mismatched-types", right, message, "compare enums that share members")
        return len(self.problems) == before

    def _compare(self, node: Compare) -> Typed:
        operands = [self._side(node.first), *(self._side(operand) for _, operand in node.rest)]
        for (operator, _), (left, right) in zip(node.rest, pairwise(operands), strict=True):
            self._check_link(operator, left, right)
        return Typed(node, BOOL, tuple(operands))

    def _side(self, node: Node) -> Typed:
        """Return one side of a comparison with its type.

        An age is allowed only as one complete side of an ordering comparison. Then the runtime can compute the instant
        at which the result of the comparison changes.
        """
        return self._known_or_age_call(node, _SECONDS) if is_age(node) and isinstance(node, Call) else self.infer(node)

    def _check_link(self, operator: Comparison, left: Typed, right: Typed) -> None:
        ages = [side for side in (left, right) if is_age(side.node)]
        if len(ages) == 2:
            message, help = "two ages cannot be compared", "compare each age with a duration"
            self._report("misplaced-age", right, message, help)
        elif ages and operator in _EQUALITY_OPERATORS:
            message = f"an age cannot be compared with '{operator}', since it changes continuously"
            self._report("misplaced-age", ages[0], message, "compare it with '<' or '>='")
        elif self._are_compatible(left, right) and operator not in _EQUALITY_OPERATORS:
            self._check_order(operator, left)

    def _check_order(self, operator: Comparison, left: Typed) -> None:
        if left.type is not None and not left.type.is_number:
            message = f"{written_text(left.node)} is {left.type}, which cannot be ordered with '{operator}'"
            self._report("wrong-operand", left, message, "compare it with '==' or '!='")

    def _in(self, node: In) -> Typed:
        left = self.infer(node.item)
        options = tuple(self.infer(option) for option in node.options)
        for option in options:
            self._are_compatible(left, option)
        return Typed(node, BOOL, (left, *options))

    def _choice(self, node: Choice) -> Typed:
        then, condition, otherwise = self.infer(node.then), self.condition(node.condition), self.infer(node.otherwise)
        return Typed(node, self._common_type((then, otherwise)), (then, condition, otherwise))

    def _fallback(self, node: Fallback) -> Typed:
        operands = self.infer(node.value), self.infer(node.otherwise)
        return Typed(node, self._common_type(operands), operands)

    def _call(self, node: Call) -> Typed:
        if node.function == "known":
            return self._known_or_age_call(node, BOOL)
        if node.function == "age":
            typed = self._known_or_age_call(node, None)
            if self._reads_context:
                message, help = "an age must be one complete side of a comparison", "write age(x) < 10 s"
                self._report("misplaced-age", typed, message, help)
            return typed
        arguments = tuple(self._quantity(argument) for argument in node.arguments)
        return Typed(node, self._common_type(arguments), arguments)

    def _known_or_age_call(self, node: Call, result: Type | None) -> Typed:
        """Return a call of `known` or `age` with its type. Report the call if it is not in a condition over context."""
        if not self._reads_context:
            message = f"{node.function}() is about context-variables, which cannot be read here"
            help = "use it in 'observable_when'; a condition with an absent returned value is unknown anyway"
            self._report("misplaced-known", Typed(node, None), message, help)
        return Typed(node, result if self._reads_context or node.function == "known" else None)


def is_age(node: Node) -> bool:
    """Return whether a node is `age(x)`."""
    return isinstance(node, Call) and node.function == "age"


def _unit_problem(left: Typed, right: Typed) -> Problem | None:
    """Return the problem if the units of two numbers do not match; None if they do."""
    if left.type is None or right.type is None or left.type.unit.dimension == right.type.unit.dimension:
        return None
    for bare, other in ((left, right), (right, left)):
        if bare.type and other.type and bare.type.unit.dimension == ONE.dimension:
            return missing_unit(bare, written_text(other.node), other.type.unit)
    message = (
        f"{written_text(left.node)} is in {left.type.unit}, but {written_text(right.node)} is in {right.type.unit}"
    )
    return Problem("mismatched-units", right.node, message, "compare quantities of one kind")


def missing_unit(bare: Typed, other: str, unit: Unit) -> Problem:
    """Return the problem of a number without a unit beside something that has a unit."""
    node_text = written_text(bare.node)
    if bare.type is not None and bare.type.is_literal:
        help = f"did you mean '{node_text} {unit}'?"
    else:
        help = "state its unit where it is declared, or remove the unit of the other value"
    return Problem("missing-unit", bare.node, f"{node_text} has no unit, but {other} is in {unit}", help)


def _mismatch_help(left: Typed, right: Typed) -> str:
    for side, other in ((left, right), (right, left)):
        if isinstance(side.node, Text) and other.type is not None:
            if other.type.kind is Kind.BOOL and side.node.value in ("true", "false"):
                return f"write {side.node.value} without quotes"
            if other.type.is_number and side.node.value.lstrip("-")[:1].isdigit():
                return "write the number without quotes"
    return "use values of one type"


_INFERENCE_METHODS: Mapping[type[Node], Callable[[_Inference, Any], Typed]] = {
    Name: _Inference._name,
    Number: _Inference._number,
    Text: _Inference._text,
    Truth: _Inference._truth,
    Not: _Inference._not,
    And: _Inference._and_or,
    Or: _Inference._and_or,
    Compare: _Inference._compare,
    In: _Inference._in,
    Arithmetic: _Inference._arithmetic,
    Negative: _Inference._negative,
    Choice: _Inference._choice,
    Fallback: _Inference._fallback,
    Call: _Inference._call,
}
