"""Find values of variables that would make conditions hold."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, islice, product

from codra_dsl.logic import Scope, Term, Value
from codra_dsl.runtime.values.condition_text import literals_of
from codra_dsl.runtime.values.model import NotOfTypeError, VariableModel

_MAX_ASSIGNMENTS = 20_000
_MAX_ENUMERATED_RANGE = 100


@dataclass(frozen=True, slots=True)
class _ChangedScope:
    """A scope in which some variables have new values, of age 0."""

    scope: Scope
    values: Mapping[str, Value]

    def value(self, name: str) -> Value | None:
        return self.values[name] if name in self.values else self.scope.value(name)

    def age_s(self, name: str) -> float | None:
        return 0.0 if name in self.values else self.scope.age_s(name)


def find_solution(
    terms: Sequence[Term], scope: Scope, variables: Mapping[str, VariableModel]
) -> dict[str, Value] | None:
    """Return values of as few variables as possible with which all terms would hold.

    Args:
        terms: the conditions.
        scope: the present values.
        variables: a mapping from names to the declared variables.

    Returns:
        A mapping from names of variables to their values; None if no such values were found.
    """
    free_variables = {name for term in terms if not term.holds(scope) for name in term.variables() if name in variables}
    solution: dict[str, Value] = {}
    for group in _groups(terms, free_variables):
        values = _solve(group, sorted(free_variables & _variables_of(group)), scope, variables)
        if values is None:
            return None
        solution |= values
    return solution


def _groups(terms: Iterable[Term], free_variables: set[str]) -> list[list[Term]]:
    """Return the terms in independent groups; terms of different groups share no free variable."""
    groups: list[list[Term]] = []
    for term in terms:
        connected_groups = [group for group in groups if free_variables & _variables_of(group) & term.variables()]
        groups = [group for group in groups if not any(group is other for other in connected_groups)]
        groups.append([*(other for group in connected_groups for other in group), term])
    return groups


def _variables_of(terms: Iterable[Term]) -> set[str]:
    return {name for term in terms for name in term.variables()}


def _solve(
    terms: Sequence[Term], free_variables: Sequence[str], scope: Scope, variables: Mapping[str, VariableModel]
) -> dict[str, Value] | None:
    texts = [repr(term) for term in terms]
    for values in islice(_assignments(free_variables, variables, texts), _MAX_ASSIGNMENTS):
        changed_scope = _ChangedScope(scope, values)
        if all(term.holds(changed_scope) for term in terms):
            return values
    return None


def _assignments(
    free_variables: Sequence[str], variables: Mapping[str, VariableModel], texts: Iterable[str]
) -> Iterator[dict[str, Value]]:
    """Yield assignments, in ascending order of the number of changed variables."""
    literals = sorted({literal for text in texts for literal in literals_of(text)}, key=repr)
    candidates = {name: tuple(_candidates(variables[name], literals)) for name in free_variables}
    for changed_count in range(len(free_variables) + 1):
        for names in combinations(free_variables, changed_count):
            for values in product(*(candidates[name] for name in names)):
                yield dict(zip(names, values, strict=True))


def _candidates(variable: VariableModel, literals: Iterable[Value]) -> Iterator[Value]:
    """Yield values that a condition can distinguish: its literals, and values on both sides of each literal."""
    value_type = variable.type
    raw_values: list[Value] = [True, False] if value_type.kind == "bool" else [*value_type.members]
    if value_type.kind == "str":
        raw_values = [*(literal for literal in literals if isinstance(literal, str)), "other"]
    if value_type.kind == "float":
        raw_values = [float(number) for number in _candidate_numbers(literals, value_type.range)]
    if value_type.kind == "int":
        raw_values = [
            int(number) for number in _candidate_numbers(literals, value_type.range) if float(number).is_integer()
        ]
    yielded_values: set[Value] = set()
    for value in raw_values:
        try:
            converted_value = value_type.convert(value)
        except NotOfTypeError:
            continue
        if converted_value is not None and converted_value not in yielded_values:
            yielded_values.add(converted_value)
            yield converted_value


def _candidate_numbers(literals: Iterable[Value], bounds: tuple[float, float] | None) -> Iterator[Value]:
    """Yield numbers that can matter in arithmetic with some literals, the simplest first."""
    finite_bounds = [bound for bound in bounds or () if math.isfinite(bound)]
    literal_numbers = [
        literal for literal in literals if isinstance(literal, (int, float)) and not isinstance(literal, bool)
    ]
    for number in literal_numbers:
        yield from (number, number + 1.0, number - 1.0, number * 1.1, number * 0.9)
    simple_numbers = sorted({0.0, *map(float, literal_numbers), *finite_bounds})
    yield from simple_numbers
    if len(finite_bounds) == 2 and finite_bounds[1] - finite_bounds[0] <= _MAX_ENUMERATED_RANGE:
        yield from range(math.ceil(finite_bounds[0]), math.floor(finite_bounds[1]) + 1)
    pairs = [(first, second) for first in simple_numbers for second in simple_numbers if first != second]
    derived_numbers = [(first + second) / 2 for first, second in pairs]
    derived_numbers += [
        derived_number for first, second in pairs for derived_number in (first - second, first + second, first * second)
    ]
    derived_numbers += [first / second for first, second in pairs if second]
    for number in (*simple_numbers, *derived_numbers):
        for step in (0.0, 1.0, -1.0, 0.1 * abs(number) or 0.1, -0.1 * abs(number) or -0.1):
            yield from (number + step, -number - step)
