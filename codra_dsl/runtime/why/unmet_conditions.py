"""Find values of variables with which conditions would hold."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, islice, product

from codra_dsl.logic import Scope, Term, Value
from codra_dsl.runtime.values.condition_text import literals_of
from codra_dsl.runtime.values.model import NotOfTypeError, VariableModel

_MOST_TRIED = 20_000
_FEW = 100


@dataclass(frozen=True, slots=True)
class _Otherwise:
    """A scope in which some variables have new values, of age 0."""

    scope: Scope
    values: Mapping[str, Value]

    def value(self, name: str) -> Value | None:
        return self.values[name] if name in self.values else self.scope.value(name)

    def age_s(self, name: str) -> float | None:
        return 0.0 if name in self.values else self.scope.age_s(name)


def wanted(terms: Sequence[Term], scope: Scope, variables: Mapping[str, VariableModel]) -> dict[str, Value] | None:
    """Return values for as few variables as possible with which all terms would hold.

    Args:
        terms: the conditions.
        scope: the present values.
        variables: the declared variables, by name.

    Returns:
        Values by variable; None if no such values were found.
    """
    free = {name for term in terms if not term.holds(scope) for name in term.variables() if name in variables}
    solution: dict[str, Value] = {}
    for group in _groups(terms, free):
        values = _solved(group, sorted(free & _read(group)), scope, variables)
        if values is None:
            return None
        solution |= values
    return solution


def _groups(terms: Iterable[Term], free: set[str]) -> list[list[Term]]:
    """Return the terms in independent groups; terms of different groups share no free variable."""
    groups: list[list[Term]] = []
    for term in terms:
        tied = [group for group in groups if free & _read(group) & term.variables()]
        groups = [group for group in groups if not any(group is other for other in tied)]
        groups.append([*(other for group in tied for other in group), term])
    return groups


def _read(terms: Iterable[Term]) -> set[str]:
    return {name for term in terms for name in term.variables()}


def _solved(
    terms: Sequence[Term], free: Sequence[str], scope: Scope, variables: Mapping[str, VariableModel]
) -> dict[str, Value] | None:
    texts = [repr(term) for term in terms]
    for values in islice(_attempts(free, variables, texts), _MOST_TRIED):
        otherwise = _Otherwise(scope, values)
        if all(term.holds(otherwise) for term in terms):
            return values
    return None


def _attempts(
    free: Sequence[str], variables: Mapping[str, VariableModel], texts: Iterable[str]
) -> Iterator[dict[str, Value]]:
    """Yield assignments, in ascending order of the number of changed variables."""
    literals = sorted({literal for text in texts for literal in literals_of(text)}, key=repr)
    candidates = {name: tuple(_candidates(variables[name], literals)) for name in free}
    for count in range(len(free) + 1):
        for names in combinations(free, count):
            for values in product(*(candidates[name] for name in names)):
                yield dict(zip(names, values, strict=True))


def _candidates(variable: VariableModel, literals: Iterable[Value]) -> Iterator[Value]:
    """Yield values between which a condition can distinguish: its literals, and values on either side of them."""
    kind = variable.type
    raw: list[Value] = [True, False] if kind.kind == "bool" else [*kind.members]
    if kind.kind == "str":
        raw = [*(literal for literal in literals if isinstance(literal, str)), "other"]
    if kind.kind == "float":
        raw = [float(number) for number in _numbers(literals, kind.range)]
    if kind.kind == "int":
        raw = [int(number) for number in _numbers(literals, kind.range) if float(number).is_integer()]
    seen: set[Value] = set()
    for value in raw:
        try:
            converted = kind.convert(value)
        except NotOfTypeError:
            continue
        if converted is not None and converted not in seen:
            seen.add(converted)
            yield converted


def _numbers(literals: Iterable[Value], bounds: tuple[float, float] | None) -> Iterator[Value]:
    """Yield numbers that can matter in arithmetic with some literals, the simplest first."""
    ends = [end for end in bounds or () if math.isfinite(end)]
    given = [literal for literal in literals if isinstance(literal, (int, float)) and not isinstance(literal, bool)]
    for number in given:
        yield from (number, number + 1.0, number - 1.0, number * 1.1, number * 0.9)
    plain = sorted({0.0, *map(float, given), *ends})
    yield from plain
    if len(ends) == 2 and ends[1] - ends[0] <= _FEW:
        yield from range(math.ceil(ends[0]), math.floor(ends[1]) + 1)
    pairs = [(first, second) for first in plain for second in plain if first != second]
    computed = [(first + second) / 2 for first, second in pairs]
    computed += [result for first, second in pairs for result in (first - second, first + second, first * second)]
    computed += [first / second for first, second in pairs if second]
    for number in (*plain, *computed):
        for step in (0.0, 1.0, -1.0, 0.1 * abs(number) or 0.1, -0.1 * abs(number) or -0.1):
            yield from (number + step, -number - step)
