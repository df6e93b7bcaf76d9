"""Members of enums that are wrong in their declaration: misspelt, or two joined by a missing comma."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from codra_dsl.language.check.conditions.conditions import Result, Role, Site
from codra_dsl.language.check.index.corrections import Owner
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import MAX_SUGGESTIONS, SpecIndex
from codra_dsl.language.check.index.words import USERS
from codra_dsl.language.check.solver.values import links
from codra_dsl.language.diagnostics import Diagnostic, Fix, Place, Related, replacing, suggest
from codra_dsl.language.expression import Choice, Name, Node, Text, walk
from codra_dsl.language.load.schema.misspelt import misspelt_declarations
from codra_dsl.language.model import Kind, Members, ValueType

Key = tuple[Owner, str]
"""An enum: a context-variable of `context`, or a returned value of an algorithm."""


@dataclass(frozen=True, slots=True)
class _Enum:
    """An enum as declared, and the places that mention its members."""

    type: ValueType
    place: Place
    user: str
    path: str
    mentions: dict[str, dict[Place, str]] = field(default_factory=dict)

    @property
    def unknown(self) -> tuple[str, ...]:
        """Return the mentioned members that are not declared."""
        return tuple(member for member in self.mentions if member not in self.type.values)

    @property
    def most_wanted(self) -> int:
        """Return the largest number of mentions of an undeclared member."""
        return max((len(self.mentions[member]) for member in self.unknown), default=0)

    def place_of(self, member: str) -> Place:
        """Return the place of a member."""
        places = self.type.places
        return places.get(f"values.{member}") or places.get("values") or self.place


def members_to_blame(scope: SpecIndex) -> Iterator[Diagnostic]:
    """Yield findings about declared members that nothing mentions, although something mentions the intended ones.

    The corrections go to `scope.corrections`.
    """
    enums = _enums(scope)
    for key, member, place, user in _mentions(scope):
        if key in enums:
            enums[key].mentions.setdefault(member, {})[place] = user
    wrong: set[str] = set()
    for key, enum in sorted(enums.items(), key=lambda entry: -entry[1].most_wanted):
        unknown = [member for member in enum.unknown if member not in wrong]
        yield from _blame(scope, key, enum, unknown[:MAX_SUGGESTIONS], wrong)


def _enums(scope: SpecIndex) -> dict[Key, _Enum]:
    enums: dict[Key, _Enum] = {}
    for variable in scope.spec.context:
        if variable.type.kind is Kind.ENUM:
            user, path = f"{USERS['context']} '{variable.name}'", f"context.{variable.name}.values"
            enums["context", variable.name] = _Enum(variable.type, variable.place, user, path)
    for algorithm in scope.spec.perception:
        for returned in algorithm.returns:
            if returned.type.kind is Kind.ENUM:
                user = f"returned value '{returned.name}' of algorithm '{algorithm.name}'"
                path = f"perception.{algorithm.name}.returns.{returned.name}.values"
                enums[(algorithm.name,), returned.name] = _Enum(returned.type, returned.place, user, path)
    return enums


def _blame(scope: SpecIndex, key: Key, enum: _Enum, unknown: list[str], wrong: set[str]) -> Iterator[Diagnostic]:
    """Yield findings about the members of one enum; misspelt ones go to `wrong`, since other enums name them too."""
    values = dict.fromkeys(enum.type.values)
    corrected: dict[str, tuple[str, ...]] = {}
    for member in values:
        pieces = tuple(member.split())
        if len(pieces) > 1 and member not in enum.mentions and any(piece in unknown for piece in pieces):
            corrected[member] = pieces
            yield _two_in_one(enum, member, pieces)
    joined = {piece for pieces in corrected.values() for piece in pieces}
    uses = {member: len({place.span for place in enum.mentions[member]}) for member in unknown if member not in joined}
    unused = [member for member in values if member not in enum.mentions and member not in corrected]
    misspelt = misspelt_declarations(uses, unused, values, scope.vocabulary, suggest) if uses and unused else {}
    for name, member in misspelt.items():
        corrected[member] = (name,)
        wrong.add(member)
        yield _misspelt(enum, member, name)
    if corrected:
        members = (intended for member in values for intended in corrected.get(member, (member,)))
        scope.corrections.members[key] = tuple(dict.fromkeys(members))


def _two_in_one(enum: _Enum, member: str, pieces: tuple[str, ...]) -> Diagnostic:
    place, apart = enum.place_of(member), ", ".join(pieces)
    message = f"the member '{member}' of {enum.user} is not used, but its words are"
    related = tuple(_related(enum, piece) for piece in pieces if piece in enum.mentions)
    fix = _replacing(place, member, apart)
    return finding("unknown-member", message, place, path=enum.path, help=f"write '{apart}'", related=related, fix=fix)


def _misspelt(enum: _Enum, member: str, name: str) -> Diagnostic:
    place = enum.place_of(member)
    message = f"the member '{member}' of {enum.user} is not used, and '{name}', which is used, is not a member"
    fix = _replacing(place, member, name)
    help = f"did you mean '{name}'?"
    return finding(
        "unknown-member", message, place, path=enum.path, help=help, related=(_related(enum, name),), fix=fix
    )


def _replacing(place: Place, member: str, intended: str) -> Fix | None:
    """Return the fix of a member; None if it is written in quotes."""
    is_plain = place.span.end_column - place.span.column == len(member)
    return replacing(place, member, intended, safe=False) if is_plain else None


def _related(enum: _Enum, member: str) -> Related:
    place, user = next(iter(enum.mentions[member].items()))
    return Related(f"'{member}' in {user}", place)


def _mentions(scope: SpecIndex) -> Iterator[tuple[Key, str, Place, str]]:
    """Yield every mention of a member, with its enum, its place, and the element that contains it."""
    for site in scope.sites:
        user = f"{USERS[site.owner[0]]} '{site.owner[1]}'"
        for key, member, node in _in_condition(scope, site):
            yield key, member, site.condition.place_of(node), user
    for algorithm in scope.spec.perception:
        for entry in algorithm.identifies:
            for case, _ in entry.by.cases if isinstance(entry.by, Members) else ():
                yield ("context", entry.variable.name), case.name, case.place, f"algorithm '{algorithm.name}'"


def _in_condition(scope: SpecIndex, site: Site) -> Iterator[tuple[Key, str, Node]]:
    tree = site.condition.tree
    assert tree is not None
    returned = site.role in (Role.ACCEPT_WHEN, Role.IDENTIFIES)
    owner: Owner = (site.owner[1],) if returned else "context"
    for one, other in ((one, other) for node in walk(tree) for _, one, other in links(node)):
        for named, value in ((one, other), (other, one)):
            if isinstance(named, Name):
                yield from (
                    ((owner, named.name), leaf.value, leaf) for leaf in _leaves(value) if isinstance(leaf, Text)
                )
    if site.result is Result.VALUE and site.variable is not None:
        for leaf in _leaves(tree):
            if isinstance(leaf, Text):
                yield ("context", site.variable), leaf.value, leaf
            elif isinstance(leaf, Name):
                yield from _handed_on(scope, site, (owner, leaf.name), leaf)


def _handed_on(scope: SpecIndex, site: Site, returned: Key, leaf: Name) -> Iterator[tuple[Key, str, Node]]:
    """Yield the members of a returned enum that becomes a context-variable, and vice versa."""
    variable = scope.variables.get(site.variable or "")
    algorithm = scope.algorithms[site.owner[1]]
    declared = next((value for value in algorithm.returns if value.name == leaf.name), None)
    if variable is not None and declared is not None and declared.type.kind is variable.type.kind is Kind.ENUM:
        yield from ((("context", variable.name), member, leaf) for member in declared.type.values)
        yield from ((returned, member, leaf) for member in variable.type.values)


def _leaves(node: Node) -> Iterator[Node]:
    """Yield the expressions that a value can equal: itself, or either side of a choice."""
    if isinstance(node, Choice):
        yield from _leaves(node.then)
        yield from _leaves(node.otherwise)
    else:
        yield node
