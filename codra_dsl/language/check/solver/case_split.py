"""The search for a case in which some conditions hold and another condition does not.

In a case, each name that occurs several times has one value: true or false, a member, or unknown. A number is
restricted to an interval between the constants with which the conditions compare it, so each comparison with a constant
has only one result. If two numbers are compared with each other several times, a case also restricts their difference.
If a question needs too many cases or too much work, it is not decided: there may be such a case.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field
from fractions import Fraction
from itertools import product

from codra_dsl.language.check.conditions.types import Types
from codra_dsl.language.check.solver.breakpoints import context_keys_of, cuts, is_curved
from codra_dsl.language.check.solver.budget import OutOfBudgetError, current_budget, shared_budget, spend
from codra_dsl.language.check.solver.intervals import Interval, hull, in_base, negative, pieces, point, quotient, total
from codra_dsl.language.check.solver.linear import Pair, pair
from codra_dsl.language.check.solver.values import (
    AGES,
    UNKNOWN,
    Context,
    UnspecifiedText,
    Value,
    Values,
    age_key,
    known_key,
    own_comparisons,
    possible_values,
)
from codra_dsl.language.expression import And, Call, Compare, In, Name, Node, Text, parts, walk
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model import Kind

MAX_CASES = 4096
"""The maximum number of cases for each group of conditions that share names.

Without this limit, one question could use up the budget for all other questions about the spec.
"""

_TRUE: Values = frozenset({True})
_FALSE: Values = frozenset({False})
_ZERO: Values = frozenset({point(Fraction(0))})


def may_have_case(
    required_conditions: Sequence[Node], claim: Node | None, values: Mapping[str, Values], types: Types
) -> bool:
    """Return whether there may be a case in which all required conditions hold and the claim, if any, does not.

    If this is not decided within the budget, the answer is that there may be such a case.

    Args:
        required_conditions: the required conditions. Groups that share no name are searched separately.
        claim: a further condition.
        values: a mapping from each name to its possible values. The values contain None if the name can be unknown.
        types: the type of each name.
    """
    conditions = required_conditions if claim is None else (*required_conditions, claim)
    with shared_budget(current_budget()) as budget:
        return budget.answer(
            lambda: _may_have_case(required_conditions, claim, values, types), conditions, undecided=True
        )


def _may_have_case(
    required_conditions: Sequence[Node], claim: Node | None, values: Mapping[str, Values], types: Types
) -> bool:
    required_conjuncts = conjuncts(required_conditions)
    context = Context(values)
    if any(True not in possible_values(condition, context) for condition in required_conjuncts):
        return False
    if claim is not None and possible_values(claim, context) == _TRUE:
        return False
    if _need_no_cases(required_conjuncts if claim is None else (*required_conjuncts, claim), types):
        return True
    answers = [_Search(group, values, types).finds_case() for group in _groups(required_conjuncts, claim)]
    if None in answers and False not in answers:
        raise OutOfBudgetError
    return False not in answers


def _need_no_cases(conditions: Iterable[Node], types: Types) -> bool:
    """Return whether no cases need to be distinguished, which is true for most conditions.

    No cases are needed if each name occurs only once, no name is an int, and there is neither `in` nor a chain of
    comparisons.
    """
    names: set[str] = set()
    for condition in conditions:
        for part in walk(condition):
            if isinstance(part, Name):
                declared = types.get(part.name)
                if part.name in names or (declared is not None and declared.kind is Kind.INT):
                    return False
                names.add(part.name)
            elif isinstance(part, In) or (isinstance(part, Compare) and len(part.rest) > 1):
                return False
    return True


def conjuncts(conditions: Iterable[Node]) -> tuple[Node, ...]:
    """Return conditions with each `and` split into its operands."""
    operands: list[Node] = []
    for condition in conditions:
        operands += conjuncts(condition.operands) if isinstance(condition, And) else [condition]
    return tuple(operands)


def names_of(conditions: Iterable[Node]) -> tuple[str, ...]:
    """Return the names that conditions mention, without repetitions."""
    nodes = (part for condition in conditions for part in walk(condition))
    return tuple(dict.fromkeys(part.name for part in nodes if isinstance(part, Name)))


@dataclass(frozen=True, slots=True)
class _Group:
    """Conditions that share names."""

    required: tuple[Node, ...]
    claim: Node | None = None

    @property
    def conditions(self) -> tuple[Node, ...]:
        """Return the required conditions and the claim."""
        return self.required if self.claim is None else (*self.required, self.claim)


def _groups(required_conditions: Sequence[Node], claim: Node | None) -> Iterable[_Group]:
    """Return the conditions in groups. Conditions in different groups have no name in common."""
    group = _Group(tuple(required_conditions), claim)
    if len(group.conditions) == 1:
        return (group,)
    leaders = list(range(len(group.conditions)))
    first_index_by_name: dict[str, int] = {}
    for index, condition in enumerate(group.conditions):
        for name in names_of([condition]):
            leaders[_leader(leaders, index)] = _leader(leaders, first_index_by_name.setdefault(name, index))
    indices_by_leader: dict[int, list[int]] = {}
    for index in leaders:
        indices_by_leader.setdefault(_leader(leaders, index), [])
    for index in range(len(leaders)):
        indices_by_leader[_leader(leaders, index)].append(index)
    return tuple(
        _Group(
            tuple(required_conditions[index] for index in indices if index < len(required_conditions)),
            claim if indices[-1] == len(required_conditions) else None,
        )
        for indices in indices_by_leader.values()
    )


def _leader(leaders: list[int], index: int) -> int:
    while leaders[index] != index:
        leaders[index] = leaders[leaders[index]]
        index = leaders[index]
    return index


@dataclass(slots=True)
class _Mentions:
    """The names, texts and comparisons in conditions.

    Attributes:
        counts: for each name, three counts: the mentions of its value, of its age, and of whether it is known. The keys
            are those of a context.
        names: the keys in `counts` that are names.
        texts: all quoted texts.
        comparisons: the two sides of each comparison.
    """

    counts: Counter[str] = field(default_factory=Counter)
    names: set[str] = field(default_factory=set)
    texts: dict[str, None] = field(default_factory=dict)
    comparisons: list[tuple[Node, Node]] = field(default_factory=list)

    def add(self, condition: Node) -> None:
        """Add a condition.

        The parts of a chain of comparisons, and of `in`, count twice, because some of them are compared several times.
        """
        pending_nodes = [(condition, 1)]
        while pending_nodes:
            node, times = pending_nodes.pop()
            spend(1)
            self.comparisons += ((left, right) for _, left, right in own_comparisons(node))
            if isinstance(node, Name):
                self.counts[node.name] += times
                self.names.add(node.name)
            elif isinstance(node, Text):
                self.texts[node.value] = None
            elif isinstance(node, Call) and node.function in ("age", "known") and isinstance(node.arguments[0], Name):
                key = age_key if node.function == "age" else known_key
                self.counts[key(node.arguments[0].name)] += times
            counts_twice = isinstance(node, In) or (isinstance(node, Compare) and len(node.rest) > 1)
            pending_nodes += ((part, 2 if counts_twice else times) for part in parts(node))


class _Search:
    """The search for a case in which all required conditions of a group hold, and its claim does not."""

    def __init__(self, group: _Group, values: Mapping[str, Values], types: Types) -> None:
        self._group = group
        self._values = {**values, "": _ZERO}
        self._types = types
        self._mentions = _Mentions()
        for condition in group.conditions:
            self._mentions.add(condition)
        self._comparisons = [
            (left, right, context_keys_of(left) | context_keys_of(right)) for left, right in self._mentions.comparisons
        ]
        self._pairs, self._sides = self._tracked_pairs()
        self._cuts_by_key: dict[str, frozenset[Fraction]] = {}

    def finds_case(self) -> bool | None:
        """Return whether there may be such a case; None if this needs too many cases.

        Cases are split until one is certain or complete, or none is left.
        """
        keys = [key for key in self._mentions.counts if self._needs_split(key)]
        keys += self._sides
        remaining_case_count = MAX_CASES
        pending_cases: list[tuple[Mapping[str, Values], int]] = [(self._values, 0)]
        while pending_cases:
            if remaining_case_count == 0:
                return None
            remaining_case_count -= 1
            values, index = pending_cases.pop()
            context = Context(values, self._pairs)
            spend(len(values))
            required_truths = [possible_values(condition, context) for condition in self._group.required]
            claim_truths = _FALSE if self._group.claim is None else possible_values(self._group.claim, context)
            if any(True not in truths for truths in required_truths) or claim_truths == _TRUE:
                continue
            if index == len(keys) or (True not in claim_truths and all(truths == _TRUE for truths in required_truths)):
                return True
            value_sets = self._value_sets(keys[index], context)
            pending_cases += (({**values, keys[index]: value_set}, index + 1) for value_set in reversed(value_sets))
        return False

    def _needs_split(self, key: str) -> bool:
        """Return whether the search splits cases by the values of a key.

        The key represents a name, the age of a name, or whether a name is known.
        """
        occurs_repeatedly = self._mentions.counts[key] > 1
        if key not in self._mentions.names:
            return occurs_repeatedly and (key in self._values or not key.startswith("known("))
        declared = self._types.get(key)
        return (
            declared is not None and self._values[key] != UNKNOWN and (occurs_repeatedly or declared.kind is Kind.INT)
        )

    def _tracked_pairs(self) -> tuple[Mapping[tuple[int, int], Pair], Mapping[str, tuple[Node, Node, Pair]]]:
        """Return the pairs of numbers whose difference occurs more than once or is 0.

        The second result maps the key of each such difference, except 0, to its two sides and their pair.

        A difference that depends on only one name is left out, since the range of this name is cut at the numbers where
        the results of its comparisons change. But if one side is curved, there are no such cuts, and the difference is
        included.
        """
        number_comparisons = [
            (left, right, pair(left, right))
            for left, right, context_keys in self._comparisons
            if context_keys and self._is_number(left) and self._is_number(right)
        ]
        counts = Counter(pair_.key for _, _, pair_ in number_comparisons)
        tracked_comparisons = [
            (left, right, pair_)
            for left, right, pair_ in number_comparisons
            if not pair_.key
            or (
                counts[pair_.key] > 1
                and (len(context_keys_of(left) | context_keys_of(right)) > 1 or is_curved(left, right))
            )
        ]
        pairs = {(id(left), id(right)): pair_ for left, right, pair_ in tracked_comparisons}
        return pairs, {pair_.key: (left, right, pair_) for left, right, pair_ in tracked_comparisons if pair_.key}

    def _is_number(self, node: Node) -> bool:
        values = possible_values(node, Context(self._values)) - UNKNOWN
        return bool(values) and all(isinstance(value, Interval) for value in values)

    def _value_sets(self, key: str, context: Context) -> Sequence[Values]:
        """Return the possible values of a name, or of the difference of two numbers, as sets that need no split."""
        if key in self._sides:
            return self._difference_sets(key, context)
        values: list[Value] = []
        for value in sorted(context.values.get(key, AGES), key=str):
            if isinstance(value, Interval):
                values += pieces(value, self._cuts(key), self._step(key))
            elif value is UnspecifiedText.ANY:
                values += (*self._texts(), UnspecifiedText.UNMENTIONED)
            else:
                values.append(value)
        return tuple(frozenset({value}) for value in values)

    def _difference_sets(self, key: str, context: Context) -> Sequence[Values]:
        """Return the pieces of the possible differences of two numbers, and UNKNOWN if a difference can be unknown."""
        left, right, own_pair = self._sides[key]
        limits = [other_pair.limit for other_pair in self._pairs.values() if other_pair.key == key]
        differences: list[Interval] = []
        unknown_sets: list[Values] = []
        for one, other in product(possible_values(left, context), possible_values(right, context)):
            if isinstance(one, Interval) and isinstance(other, Interval):
                scaled_difference = quotient(total(one, negative(other)), point(own_pair.factor))
                differences.append(total(scaled_difference, point(own_pair.limit)))
            else:
                unknown_sets = [UNKNOWN]
        return (
            *unknown_sets,
            *(frozenset({part}) for part in (pieces(hull(differences), limits, None) if differences else ())),
        )

    def _cuts(self, key: str) -> frozenset[Fraction]:
        if key not in self._cuts_by_key:
            own_keys = frozenset({key})
            sides = ((left, right) for left, right, context_keys in self._comparisons if context_keys == own_keys)
            self._cuts_by_key[key] = cuts(key, sides)
        return self._cuts_by_key[key]

    def _step(self, key: str) -> Fraction | None:
        """Return the step between the values of an int, in base units; None for other types."""
        declared = self._types.get(key)
        step = in_base(1, declared.unit) if declared is not None and declared.kind is Kind.INT else None
        return step if isinstance(step, Fraction) else None

    def _texts(self) -> Iterable[str]:
        """Return the texts that a str may be compared with: quoted texts and members."""
        types = (self._types.get(name) for name in self._mentions.counts)
        members = (member for declared in types if declared is not None for member in declared.values)
        return dict.fromkeys((*self._mentions.texts, *members))
