"""The search for a case in which some conditions hold and another condition does not.

A case restricts each name that occurs several times: to a bool, to a member, to unknown or, for a number, to one of the
pieces into which the conditions cut its range. Within a case, each comparison of such a name with constants has only
one result. If the same two numbers are compared with each other twice, their difference is treated as one number. After
MAX_CASES cases, the answer is that there may be such a case.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import product

from codra_dsl.language.check.conditions.types import Types
from codra_dsl.language.check.solver.breakpoints import cuts, is_curved, subjects
from codra_dsl.language.check.solver.intervals import Interval, hull, in_base, negative, pieces, point, quotient, total
from codra_dsl.language.check.solver.linear import Pair, pair
from codra_dsl.language.check.solver.values import (
    AGES,
    UNKNOWN,
    Context,
    Other,
    Value,
    Values,
    age_key,
    known_key,
    links,
    outcomes,
)
from codra_dsl.language.expression import And, Call, Compare, In, Name, Node, Text, parts, walk
from codra_dsl.language.model import Kind

MAX_CASES = 4096
"""The maximum number of cases for each group of conditions that share names. For long conditions, it is smaller."""

MAX_WORK = 100_000
"""The maximum number of evaluated parts of conditions, in all cases of a group."""

_TRUE: Values = frozenset({True})
_FALSE: Values = frozenset({False})
_ZERO: Values = frozenset({point(Fraction(0))})


def is_case(required: Sequence[Node], claim: Node | None, values: Mapping[str, Values], types: Types) -> bool:
    """Return whether there may be a case in which all required conditions hold and the claim, if any, does not.

    Args:
        required: the required conditions. Groups that share no name are searched separately.
        claim: a further condition.
        values: the possible values of each name in the conditions. They contain None if the name can be unknown.
        types: the type of each name.
    """
    required_parts = conjuncts(required)
    context = Context(values)
    if any(True not in outcomes(condition, context) for condition in required_parts):
        return False
    if claim is not None and outcomes(claim, context) == _TRUE:
        return False
    if _are_settled(required_parts if claim is None else (*required_parts, claim), types):
        return True
    return all(_Search(group, values, types).finds_case() for group in _groups(required_parts, claim))


def _are_settled(conditions: Iterable[Node], types: Types) -> bool:
    """Return whether no cases need to be distinguished, as in most conditions.

    This is so if each name occurs only once, no name is an int, and there is neither `in` nor a chain of comparisons.
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
    """Return the names that conditions mention, each once."""
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


def _groups(required: Sequence[Node], claim: Node | None) -> Iterable[_Group]:
    """Return conditions in groups that share no names with each other."""
    group = _Group(tuple(required), claim)
    if len(group.conditions) == 1:
        return (group,)
    leader = list(range(len(group.conditions)))
    first: dict[str, int] = {}
    for index, condition in enumerate(group.conditions):
        for name in names_of([condition]):
            leader[_leader(leader, index)] = _leader(leader, first.setdefault(name, index))
    members: dict[int, list[int]] = {}
    for index in leader:
        members.setdefault(_leader(leader, index), [])
    for index in range(len(leader)):
        members[_leader(leader, index)].append(index)
    return tuple(
        _Group(
            tuple(required[index] for index in indices if index < len(required)),
            claim if indices[-1] == len(required) else None,
        )
        for indices in members.values()
    )


def _leader(leader: list[int], index: int) -> int:
    while leader[index] != index:
        leader[index] = leader[leader[index]]
        index = leader[index]
    return index


@dataclass(slots=True)
class _Mentions:
    """The names, texts and comparisons in conditions.

    Attributes:
        counts: for the key of each name, of its age, and of whether it is known: how often this affects the result.
        names: the keys in `counts` that are names.
        texts: all quoted texts.
        links: the two sides of each comparison.
        size: the number of parts of the conditions.
    """

    counts: Counter[str] = field(default_factory=Counter)
    names: set[str] = field(default_factory=set)
    texts: dict[str, None] = field(default_factory=dict)
    links: list[tuple[Node, Node]] = field(default_factory=list)
    size: int = 0

    def add(self, condition: Node) -> None:
        """Add a condition. The parts of a chain, and of `in`, count twice: some are compared several times."""
        pending_nodes = [(condition, 1)]
        while pending_nodes:
            node, times = pending_nodes.pop()
            self.size += 1
            self.links += ((left, right) for _, left, right in links(node))
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
        self._links = [(left, right, subjects(left) | subjects(right)) for left, right in self._mentions.links]
        self._pairs, self._sides = self._contested_pairs()

    def finds_case(self) -> bool:
        """Return whether there may be such a case. Cases are split until one is certain or none is left."""
        keys = [key for key in self._mentions.counts if self._is_contested(key)]
        keys += self._sides
        remaining_case_count = max(1, min(MAX_CASES, MAX_WORK // self._mentions.size))
        pending_cases: list[tuple[Mapping[str, Values], int]] = [(self._values, 0)]
        while pending_cases and remaining_case_count > 0:
            remaining_case_count -= 1
            values, index = pending_cases.pop()
            context = Context(values, self._pairs)
            required_truths = [outcomes(condition, context) for condition in self._group.required]
            claim_truths = _FALSE if self._group.claim is None else outcomes(self._group.claim, context)
            if any(True not in truths for truths in required_truths) or claim_truths == _TRUE:
                continue
            if index == len(keys) or (True not in claim_truths and all(truths == _TRUE for truths in required_truths)):
                return True
            cells = self._cells(keys[index], context)
            pending_cases += (({**values, keys[index]: cell}, index + 1) for cell in reversed(cells))
        return bool(pending_cases)

    def _is_contested(self, key: str) -> bool:
        """Return whether the search splits by the values of a key, i.e. of a name, of its age, or of being known."""
        occurs_repeatedly = self._mentions.counts[key] > 1
        if key not in self._mentions.names:
            return occurs_repeatedly and (key in self._values or not key.startswith("known("))
        declared = self._types.get(key)
        return (
            declared is not None and self._values[key] != UNKNOWN and (occurs_repeatedly or declared.kind is Kind.INT)
        )

    def _contested_pairs(self) -> tuple[Mapping[tuple[int, int], Pair], Mapping[str, tuple[Node, Node, Pair]]]:
        """Return the pairs of numbers whose difference occurs more than once or is 0.

        For each key of a difference that is not 0, also return the two sides and their pair.

        Differences that depend on only one name are left out, since the range of this name is cut where its comparisons
        change. If one of the sides is curved, the difference is included, because then there are no such cuts.
        """
        number_comparisons = [
            (left, right, pair(left, right))
            for left, right, on in self._links
            if on and self._is_number(left) and self._is_number(right)
        ]
        counts = Counter(pair_.key for _, _, pair_ in number_comparisons)
        contested_comparisons = [
            (left, right, pair_)
            for left, right, pair_ in number_comparisons
            if not pair_.key
            or (counts[pair_.key] > 1 and (len(subjects(left) | subjects(right)) > 1 or is_curved(left, right)))
        ]
        pairs = {(id(left), id(right)): pair_ for left, right, pair_ in contested_comparisons}
        return pairs, {pair_.key: (left, right, pair_) for left, right, pair_ in contested_comparisons if pair_.key}

    def _is_number(self, node: Node) -> bool:
        values = outcomes(node, Context(self._values)) - UNKNOWN
        return bool(values) and all(isinstance(value, Interval) for value in values)

    def _cells(self, key: str, context: Context) -> Sequence[Values]:
        """Return the possible values of a name, or of the difference of two numbers, in sets that need no split."""
        if key in self._sides:
            return self._difference_cells(key, context)
        cells: list[Value] = []
        for value in sorted(context.values.get(key, AGES), key=str):
            if isinstance(value, Interval):
                cells += pieces(value, self._cuts(key), self._step(key))
            elif value is Other.ANY:
                cells += (*self._texts(), Other.UNMENTIONED)
            else:
                cells.append(value)
        return tuple(frozenset({cell}) for cell in cells)

    def _difference_cells(self, key: str, context: Context) -> Sequence[Values]:
        """Return the pieces of the possible differences of two numbers, and UNKNOWN if this is possible too."""
        left, right, own_pair = self._sides[key]
        limits = [other_pair.limit for other_pair in self._pairs.values() if other_pair.key == key]
        differences: list[Interval] = []
        cells: list[Values] = []
        for one, other in product(outcomes(left, context), outcomes(right, context)):
            if isinstance(one, Interval) and isinstance(other, Interval):
                scaled = quotient(total(one, negative(other)), point(own_pair.factor))
                differences.append(total(scaled, point(own_pair.limit)))
            else:
                cells = [UNKNOWN]
        return (
            *cells,
            *(frozenset({part}) for part in (pieces(hull(differences), limits, None) if differences else ())),
        )

    def _cuts(self, key: str) -> frozenset[Fraction]:
        own = frozenset({key})
        return cuts(key, ((left, right) for left, right, on in self._links if on == own))

    def _step(self, key: str) -> Fraction | None:
        """Return the number, in base units, of which each value of an int is a multiple; None for other types."""
        declared = self._types.get(key)
        step = in_base(1, declared.unit) if declared is not None and declared.kind is Kind.INT else None
        return step if isinstance(step, Fraction) else None

    def _texts(self) -> Iterable[str]:
        """Return the texts that a str may be compared with: quoted texts and members."""
        types = (self._types.get(name) for name in self._mentions.counts)
        members = (member for declared in types if declared is not None for member in declared.values)
        return dict.fromkeys((*self._mentions.texts, *members))
