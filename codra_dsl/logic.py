"""Three-valued logic and arithmetic over context: the meaning of conditions, for the checker and at run time alike.

The unknown value is None, which is not the same as False (P1, section 3.3: a flag states whether a value is known).
`and`, `or` and `not` are Kleene's: if the result is the same for every possible value of the unknown input, the result
is known. NaN, division by zero, overflow and absent optional values are unknown. An infinite value may be compared, but
the result of arithmetic is unknown if it is not finite.

A condition is a tree of frozen `Term` objects, written with Python's operators: `value("markers") >= 3`, `~known("a") |
(age("a") > 10.0)`. So a comparison of two terms is a new term; to test whether two terms are equal, compare their
`repr`.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

FLIP_STEP_S = 1e-6
"""A comparison such as `age(x) > 10 s` changes just after the age is 10 s, so it is evaluated again this much later."""

Value = bool | int | float | str
"""The values of a context-variable or a returned value."""


class Scope(Protocol):
    """Where a term finds values: the context at one instant, or the result of a perception algorithm."""

    def value(self, name: str) -> Value | None:
        """Return the value, or None when it is unknown."""
        ...

    def age_s(self, name: str) -> float | None:
        """Return the time since the evidence was taken, in seconds, or None when the value is unknown."""
        ...


class Term:
    """A part of a condition. Its `repr` is the Python text that builds it."""

    __slots__ = ("_reads",)
    _reads: tuple[frozenset[str], bool]

    def evaluate(self, scope: Scope) -> Value | None:
        """Return the term's value in a scope, or None when it is unknown."""
        raise NotImplementedError

    def parts(self) -> tuple[Term, ...]:
        """Return the terms of which this term is made."""
        return ()

    def walk(self) -> Iterator[Term]:
        """Return this term and all terms below it."""
        pending: list[Term] = [self]
        while pending:
            term = pending.pop()
            yield term
            pending.extend(reversed(term.parts()))

    def variables(self) -> frozenset[str]:
        """Return the names that the term reads."""
        return self.reads[0]

    @property
    def reads(self) -> tuple[frozenset[str], bool]:
        """Return the names that the term reads, and whether the term reads an age; they are computed once."""
        if not hasattr(self, "_reads"):
            leaves = [term for term in self.walk() if isinstance(term, (_Variable, _Known, _Age))]
            reads_age = any(isinstance(term, _Age) for term in leaves)
            object.__setattr__(self, "_reads", (frozenset(term.name for term in leaves), reads_age))
        return self._reads

    def holds(self, scope: Scope) -> bool:
        """Return whether the term is certainly true: a precondition that is unknown does not hold."""
        return self.evaluate(scope) is True

    def flips_s(self, scope: Scope) -> float | None:
        """Return in how many seconds a comparison with an age next changes if no variable changes, or None if never."""
        waits_s = (term.flip_s(scope) for term in self.walk() if isinstance(term, _Comparison))
        return min((wait_s for wait_s in waits_s if wait_s is not None), default=None)

    def is_in(self, *options: Value) -> Term:
        """Return a term that is true when the value is one of `options`."""
        return _Membership(self, options)

    def __lt__(self, other: Operand) -> Term:
        return _Comparison("<", self, _term(other))

    def __le__(self, other: Operand) -> Term:
        return _Comparison("<=", self, _term(other))

    def __gt__(self, other: Operand) -> Term:
        return _Comparison(">", self, _term(other))

    def __ge__(self, other: Operand) -> Term:
        return _Comparison(">=", self, _term(other))

    def __eq__(self, other: Operand) -> Term:  # type: ignore[override]
        return _Comparison("==", self, _term(other))

    def __ne__(self, other: Operand) -> Term:  # type: ignore[override]
        return _Comparison("!=", self, _term(other))

    __hash__ = object.__hash__

    def __bool__(self) -> bool:
        raise TypeError("a condition has no truth value of its own: use & | ~ to combine and evaluate() to decide")

    def __and__(self, other: Operand) -> Term:
        return _Conjunction((*_operands(_Conjunction, self), *_operands(_Conjunction, _term(other))))

    def __or__(self, other: Operand) -> Term:
        return _Disjunction((*_operands(_Disjunction, self), *_operands(_Disjunction, _term(other))))

    def __invert__(self) -> Term:
        return _Negation(self)

    def __add__(self, other: Operand) -> Term:
        return _Arithmetic("+", self, _term(other))

    def __radd__(self, other: Operand) -> Term:
        return _Arithmetic("+", _term(other), self)

    def __sub__(self, other: Operand) -> Term:
        return _Arithmetic("-", self, _term(other))

    def __rsub__(self, other: Operand) -> Term:
        return _Arithmetic("-", _term(other), self)

    def __mul__(self, other: Operand) -> Term:
        return _Arithmetic("*", self, _term(other))

    def __rmul__(self, other: Operand) -> Term:
        return _Arithmetic("*", _term(other), self)

    def __truediv__(self, other: Operand) -> Term:
        return _Arithmetic("/", self, _term(other))

    def __rtruediv__(self, other: Operand) -> Term:
        return _Arithmetic("/", _term(other), self)

    def __neg__(self) -> Term:
        return _Function("-", (self,))

    def __abs__(self) -> Term:
        return _Function("abs", (self,))


Operand = Term | bool | int | float | str


def literal(constant: Value) -> Term:
    """Return a term with a fixed value."""
    return _Literal(constant)


def value(name: str) -> Term:
    """Return the value of a context-variable or of a returned value."""
    return _Variable(name)


def known(name: str) -> Term:
    """Return whether a context-variable is known: always true or false, never unknown."""
    return _Known(name)


def age(name: str) -> Term:
    """Return the time since a variable's evidence was taken, in seconds; unknown while the variable is unknown."""
    return _Age(name)


def minimum(first: Operand, *others: Operand) -> Term:
    """Return the smallest of the terms; the result is unknown when one of them is unknown."""
    return _Function("minimum", tuple(_term(term) for term in (first, *others)))


def maximum(first: Operand, *others: Operand) -> Term:
    """Return the largest of the terms; the result is unknown when one of them is unknown."""
    return _Function("maximum", tuple(_term(term) for term in (first, *others)))


def choose(then: Operand, condition: Operand, otherwise: Operand) -> Term:
    """Return `then` where the condition is true, and `otherwise` where it is false.

    Where the condition is unknown, the result is known only if `then` and `otherwise` are equal.
    """
    return _Choice(_term(then), _term(condition), _term(otherwise))


def first_of(*cases: tuple[Value, Operand]) -> Term:
    """Return the value of the first case with a true condition.

    The result is unknown if the condition of an earlier case is unknown, or if no condition is true.
    """
    return _FirstOf(tuple((result, _term(condition)) for result, condition in cases))


def reads_ages(term: Term) -> bool:
    """Return whether the value of a term may change although no variable changes."""
    return term.reads[1]


def _term(operand: Operand) -> Term:
    return operand if isinstance(operand, Term) else _Literal(operand)


def _operands(kind: type[_Conjunction] | type[_Disjunction], term: Term) -> tuple[Term, ...]:
    return term.terms if isinstance(term, kind) else (term,)


def _grouped_text(term: Term) -> str:
    """Return the text of an operand, in parentheses where an operator beside the operand could change its meaning."""
    return f"({term!r})" if isinstance(term, (_Conjunction, _Disjunction, _Comparison, _Arithmetic)) else repr(term)


def _method_operand_text(term: Term) -> str:
    """Return the text of a term whose method is called: `.` binds closer than any operator."""
    is_prefixed = isinstance(term, _Negation) or (isinstance(term, _Function) and term.name == "-")
    return f"({term!r})" if is_prefixed else _grouped_text(term)


def _constant_text(constant: Value) -> str:
    is_finite = not isinstance(constant, float) or math.isfinite(constant)
    return repr(constant) if is_finite else f"float({str(constant)!r})"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class _Literal(Term):
    constant: Value

    def evaluate(self, scope: Scope) -> Value | None:  # noqa: ARG002 - it is the same everywhere
        return None if self.constant != self.constant else self.constant

    def __repr__(self) -> str:
        return f"literal({_constant_text(self.constant)})"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class _Variable(Term):
    name: str

    def evaluate(self, scope: Scope) -> Value | None:
        current_value = scope.value(self.name)
        return (
            None if current_value != current_value else current_value
        )  # NaN is the one value that differs from itself

    def __repr__(self) -> str:
        return f"value({self.name!r})"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class _Known(Term):
    name: str

    def evaluate(self, scope: Scope) -> Value | None:
        current_value = scope.value(self.name)
        return current_value is not None and current_value == current_value

    def __repr__(self) -> str:
        return f"known({self.name!r})"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class _Age(Term):
    name: str

    def evaluate(self, scope: Scope) -> Value | None:
        return scope.age_s(self.name)

    def __repr__(self) -> str:
        return f"age({self.name!r})"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class _Conjunction(Term):
    terms: tuple[Term, ...]

    def parts(self) -> tuple[Term, ...]:
        return self.terms

    def evaluate(self, scope: Scope) -> Value | None:
        result: bool | None = True
        for term in self.terms:
            truth = term.evaluate(scope)
            if truth is False:
                return False
            if truth is None:
                result = None
        return result

    def __repr__(self) -> str:
        return " & ".join(map(_grouped_text, self.terms))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class _Disjunction(Term):
    terms: tuple[Term, ...]

    def parts(self) -> tuple[Term, ...]:
        return self.terms

    def evaluate(self, scope: Scope) -> Value | None:
        result: bool | None = False
        for term in self.terms:
            truth = term.evaluate(scope)
            if truth is True:
                return True
            if truth is None:
                result = None
        return result

    def __repr__(self) -> str:
        return " | ".join(map(_grouped_text, self.terms))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class _Negation(Term):
    term: Term

    def parts(self) -> tuple[Term, ...]:
        return (self.term,)

    def evaluate(self, scope: Scope) -> Value | None:
        truth = self.term.evaluate(scope)
        return None if truth is None else not truth

    def __repr__(self) -> str:
        return f"~{_grouped_text(self.term)}"


_COMPARISONS: dict[str, Callable[[Value, Value], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
}


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class _Comparison(Term):
    symbol: str
    left: Term
    right: Term

    def parts(self) -> tuple[Term, ...]:
        return (self.left, self.right)

    def evaluate(self, scope: Scope) -> Value | None:
        left, right = self.left.evaluate(scope), self.right.evaluate(scope)
        if left is None or right is None:
            return None
        return _COMPARISONS[self.symbol](left, right)

    def flip_s(self, scope: Scope) -> float | None:
        """Return in how many seconds an age on one side reaches the other side, or None if the age has passed it."""
        for aging_term, other_term in ((self.left, self.right), (self.right, self.left)):
            if isinstance(aging_term, _Age) and not isinstance(other_term, _Age):
                age_s, limit_s = aging_term.evaluate(scope), other_term.evaluate(scope)
                if isinstance(age_s, (int, float)) and isinstance(limit_s, (int, float)):
                    return max(limit_s - age_s, FLIP_STEP_S) if limit_s >= age_s else None
        return None

    def __repr__(self) -> str:
        return f"{_grouped_text(self.left)} {self.symbol} {_side_text(self.right)}"


def _side_text(term: Term) -> str:
    return _constant_text(term.constant) if isinstance(term, _Literal) else _grouped_text(term)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class _Membership(Term):
    term: Term
    options: tuple[Value, ...]

    def parts(self) -> tuple[Term, ...]:
        return (self.term,)

    def evaluate(self, scope: Scope) -> Value | None:
        operand_value = self.term.evaluate(scope)
        return None if operand_value is None else operand_value in self.options

    def __repr__(self) -> str:
        return f"{_method_operand_text(self.term)}.is_in({', '.join(map(_constant_text, self.options))})"


_ARITHMETIC: dict[str, Callable[[float, float], float]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
}


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class _Arithmetic(Term):
    symbol: str
    left: Term
    right: Term

    def parts(self) -> tuple[Term, ...]:
        return (self.left, self.right)

    def evaluate(self, scope: Scope) -> Value | None:
        left, right = self.left.evaluate(scope), self.right.evaluate(scope)
        if not isinstance(left, (int, float)) or not isinstance(right, (int, float)):
            return None
        try:
            result = _ARITHMETIC[self.symbol](left, right)
            return result if math.isfinite(result) else None
        except ArithmeticError:  # also when an int is too large for a float
            return None

    def __repr__(self) -> str:
        return f"{_grouped_text(self.left)} {self.symbol} {_side_text(self.right)}"


_FUNCTIONS: dict[str, Callable[[list[float]], float]] = {
    "-": lambda numbers: -numbers[0],
    "abs": lambda numbers: abs(numbers[0]),
    "minimum": min,
    "maximum": max,
}


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class _Function(Term):
    name: str
    arguments: tuple[Term, ...]

    def parts(self) -> tuple[Term, ...]:
        return self.arguments

    def evaluate(self, scope: Scope) -> Value | None:
        numbers = [argument.evaluate(scope) for argument in self.arguments]
        if any(not isinstance(number, (int, float)) for number in numbers):
            return None
        return _FUNCTIONS[self.name](numbers)  # type: ignore[arg-type]

    def __repr__(self) -> str:
        if self.name == "-":
            return f"-{_grouped_text(self.arguments[0])}"
        return f"{self.name}({', '.join(map(repr, self.arguments))})"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class _Choice(Term):
    then: Term
    condition: Term
    otherwise: Term

    def parts(self) -> tuple[Term, ...]:
        return (self.then, self.condition, self.otherwise)

    def evaluate(self, scope: Scope) -> Value | None:
        truth = self.condition.evaluate(scope)
        if truth is not None:
            return (self.then if truth else self.otherwise).evaluate(scope)
        then, otherwise = self.then.evaluate(scope), self.otherwise.evaluate(scope)
        return then if then == otherwise else None

    def __repr__(self) -> str:
        return f"choose({self.then!r}, {self.condition!r}, {self.otherwise!r})"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class _FirstOf(Term):
    cases: tuple[tuple[Value, Term], ...]

    def parts(self) -> tuple[Term, ...]:
        return tuple(condition for _, condition in self.cases)

    def evaluate(self, scope: Scope) -> Value | None:
        for result, condition in self.cases:
            truth = condition.evaluate(scope)
            if truth is not False:
                return result if truth else None
        return None

    def __repr__(self) -> str:
        cases = (f"({_constant_text(result)}, {condition!r})" for result, condition in self.cases)
        return f"first_of({', '.join(cases)})"


Conjunction = _Conjunction
Disjunction = _Disjunction
Choice = _Choice
"""Terms with several parts, one of which may decide the value; public for code that finds this part."""
