"""Whether there may be a case in which some conditions hold and others do not.

A case says what each name is that stands several times: a bool or a member, unknown, or, for a number, one of the
pieces into which the conditions cut its range. Within a case each comparison of such a name with constants is settled.
Numbers that are compared with each other, twice, are treated as one number, that they come to. Past MAX_CASES the
answer is that there may be such a case.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import product

from codra_dsl.check.cuts import cuts, is_curved, subjects
from codra_dsl.check.intervals import Interval, hull, in_base, negative, pieces, point, quotient, total
from codra_dsl.check.outcomes import (
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
from codra_dsl.check.sums import Pair, pair
from codra_dsl.check.types import Types
from codra_dsl.expression import And, Call, Compare, In, Name, Node, Text, parts, walk
from codra_dsl.model import Kind

MAX_CASES = 4096
"""How many cases are looked at, for each group of conditions that share names; fewer where they are long."""

MAX_WORK = 100_000
"""How many parts of conditions are looked at, in all cases of a group."""

_TRUE: Values = frozenset({True})
_FALSE: Values = frozenset({False})
_ZERO: Values = frozenset({point(Fraction(0))})


def is_case(required: Sequence[Node], claim: Node | None, values: Mapping[str, Values], types: Types) -> bool:
    """Return whether there may be a case in which all that is required holds and a claim, if there is one, does not.

    Args:
        required: conditions; those that share no name are looked at apart.
        claim: a further condition.
        values: what each name in them can be, and whether it can be unknown.
        types: what each name is.
    """
    wanted = conjuncts(required)
    context = Context(values)
    if any(True not in outcomes(condition, context) for condition in wanted):
        return False
    if claim is not None and outcomes(claim, context) == _TRUE:
        return False
    if _are_settled(wanted if claim is None else (*wanted, claim), types):
        return True
    return all(_Search(group, values, types).finds_case() for group in _groups(wanted, claim))


def _are_settled(conditions: Iterable[Node], types: Types) -> bool:
    """Return whether each name decides but once, so that there are no cases to be told apart: as in most conditions."""
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
    """Return conditions with each `and` taken apart."""
    found: list[Node] = []
    for condition in conditions:
        found += conjuncts(condition.operands) if isinstance(condition, And) else [condition]
    return tuple(found)


def names_of(conditions: Iterable[Node]) -> tuple[str, ...]:
    """Return the names that conditions mention, each once."""
    found = (part for condition in conditions for part in walk(condition))
    return tuple(dict.fromkeys(part.name for part in found if isinstance(part, Name)))


@dataclass(frozen=True, slots=True)
class _Group:
    """Conditions that share names."""

    required: tuple[Node, ...]
    claim: Node | None = None

    @property
    def conditions(self) -> tuple[Node, ...]:
        """Return what is required and what is claimed."""
        return self.required if self.claim is None else (*self.required, self.claim)


def _groups(required: Sequence[Node], claim: Node | None) -> Iterable[_Group]:
    """Return conditions in groups that share no names with each other."""
    whole = _Group(tuple(required), claim)
    if len(whole.conditions) == 1:
        return (whole,)
    leader = list(range(len(whole.conditions)))
    first: dict[str, int] = {}
    for index, condition in enumerate(whole.conditions):
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
    """What conditions mention.

    Attributes:
        counts: how often a name, its age, and whether it is known take part in deciding.
        names: those of the keys in `counts` that are names.
        texts: all that stand between quotes.
        links: the two sides of each comparison.
        size: how many parts the conditions have.
    """

    counts: Counter[str] = field(default_factory=Counter)
    names: set[str] = field(default_factory=set)
    texts: dict[str, None] = field(default_factory=dict)
    links: list[tuple[Node, Node]] = field(default_factory=list)
    size: int = 0

    def add(self, condition: Node) -> None:
        """Count what a condition mentions: the middle of a chain, and what is `in` a list, decide several times."""
        waiting = [(condition, 1)]
        while waiting:
            node, times = waiting.pop()
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
            several = isinstance(node, In) or (isinstance(node, Compare) and len(node.rest) > 1)
            waiting += ((part, 2 if several else times) for part in parts(node))


class _Search:
    """The search for a case in which all that is required in a group holds, and its claim does not."""

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
        """Return whether there may be such a case: tell cases apart until one is certain or none is left."""
        keys = [key for key in self._mentions.counts if self._is_contested(key)]
        keys += self._sides
        left = max(1, min(MAX_CASES, MAX_WORK // self._mentions.size))
        waiting: list[tuple[Mapping[str, Values], int]] = [(self._values, 0)]
        while waiting and left > 0:
            left -= 1
            values, index = waiting.pop()
            context = Context(values, self._pairs)
            held = [outcomes(condition, context) for condition in self._group.required]
            claimed = _FALSE if self._group.claim is None else outcomes(self._group.claim, context)
            if any(True not in each for each in held) or claimed == _TRUE:
                continue
            if index == len(keys) or (True not in claimed and all(each == _TRUE for each in held)):
                return True
            cells = self._cells(keys[index], context)
            waiting += (({**values, keys[index]: cell}, index + 1) for cell in reversed(cells))
        return bool(waiting)

    def _is_contested(self, key: str) -> bool:
        """Return whether cases tell apart what a name or an age can be, or, where that is open, if a name is known."""
        several = self._mentions.counts[key] > 1
        if key not in self._mentions.names:
            return several and (key in self._values or not key.startswith("known("))
        declared = self._types.get(key)
        return declared is not None and self._values[key] != UNKNOWN and (several or declared.kind is Kind.INT)

    def _contested_pairs(self) -> tuple[Mapping[tuple[int, int], Pair], Mapping[str, tuple[Node, Node, Pair]]]:
        """Return the pairs of numbers that come to the same more than once, or to 0; and the sides of the former.

        A number that depends on one name is none, for what the name can be is cut where comparisons of it change, but
        where it is curved there are no such cuts.
        """
        several = [
            (left, right, pair(left, right))
            for left, right, on in self._links
            if on and self._is_number(left) and self._is_number(right)
        ]
        counts = Counter(found.key for _, _, found in several)
        contested = [
            (left, right, found)
            for left, right, found in several
            if not found.key
            or (counts[found.key] > 1 and (len(subjects(left) | subjects(right)) > 1 or is_curved(left, right)))
        ]
        pairs = {(id(left), id(right)): found for left, right, found in contested}
        return pairs, {found.key: (left, right, found) for left, right, found in contested if found.key}

    def _is_number(self, node: Node) -> bool:
        found = outcomes(node, Context(self._values)) - UNKNOWN
        return bool(found) and all(isinstance(value, Interval) for value in found)

    def _cells(self, key: str, context: Context) -> Sequence[Values]:
        """Return what a name can be, or how two numbers can compare, in sets that need not be told apart further."""
        if key in self._sides:
            return self._numbers(key, context)
        found: list[Value] = []
        for value in sorted(context.values.get(key, AGES), key=str):
            if isinstance(value, Interval):
                found += pieces(value, self._cuts(key), self._step(key))
            elif value is Other.ANY:
                found += (*self._texts(), Other.UNMENTIONED)
            else:
                found.append(value)
        return tuple(frozenset({each}) for each in found)

    def _numbers(self, key: str, context: Context) -> Sequence[Values]:
        """Return the pieces of what two numbers can come to, and whether that can be unknown."""
        left, right, two = self._sides[key]
        limits = [found.limit for found in self._pairs.values() if found.key == key]
        found: list[Interval] = []
        cells: list[Values] = []
        for one, other in product(outcomes(left, context), outcomes(right, context)):
            if isinstance(one, Interval) and isinstance(other, Interval):
                scaled = quotient(total(one, negative(other)), point(two.factor))
                found.append(total(scaled, point(two.limit)))
            else:
                cells = [UNKNOWN]
        return (*cells, *(frozenset({each}) for each in (pieces(hull(found), limits, None) if found else ())))

    def _cuts(self, key: str) -> frozenset[Fraction]:
        own = frozenset({key})
        return cuts(key, ((left, right) for left, right, on in self._links if on == own))

    def _step(self, key: str) -> Fraction | None:
        """Return of what a name that is an int is a multiple, in base units."""
        declared = self._types.get(key)
        step = in_base(1, declared.unit) if declared is not None and declared.kind is Kind.INT else None
        return step if isinstance(step, Fraction) else None

    def _texts(self) -> Iterable[str]:
        """Return the texts that a str may be compared with: those between quotes, and members."""
        types = (self._types.get(name) for name in self._mentions.counts)
        members = (member for each in types if each is not None for member in each.values)
        return dict.fromkeys((*self._mentions.texts, *members))
