"""Members of enums with a wrong declaration: a member is misspelt, or a comma between two members is missing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field

from codra_dsl.language.check.conditions.conditions import Result, Role, Site
from codra_dsl.language.check.index.corrections import Owner
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import MAX_SUGGESTIONS, SpecIndex
from codra_dsl.language.check.index.words import USERS
from codra_dsl.language.check.solver.values import own_comparisons
from codra_dsl.language.diagnostics import Diagnostic, Fix, Place, Related, replacement_fix, suggest
from codra_dsl.language.expression import Choice, Fallback, Name, Node, Text, walk
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.load.schema.misspelt_names import misspelt_declarations
from codra_dsl.language.model import Kind, Members, ValueType

Key = tuple[Owner, str]
"""The owner and the name of an enum, which is a context-variable or a returned value of an algorithm."""


@dataclass(frozen=True, slots=True)
class _Enum:
    """An enum as declared, and the places that mention its members."""

    type: ValueType
    place: Place
    user: str
    path: str
    mentions: dict[str, dict[Place, str]] = field(default_factory=dict)

    @property
    def unknown_members(self) -> tuple[str, ...]:
        """Return the mentioned members that are not declared."""
        return tuple(member for member in self.mentions if member not in self.type.values)

    @property
    def max_unknown_mention_count(self) -> int:
        """Return the largest number of mentions of one undeclared member."""
        return max((len(self.mentions[member]) for member in self.unknown_members), default=0)

    def place_of(self, member: str) -> Place:
        """Return the place of a member."""
        places = self.type.places
        return places.get(f"values.{member}") or places.get("values") or self.place


def wrong_member_findings(spec_index: SpecIndex) -> Iterator[Diagnostic]:
    """Yield findings about wrong members in declarations, if conditions mention the intended members instead.

    The corrections are added to `spec_index.corrections`.
    """
    enums = _enums(spec_index)
    for key, member, place, user in _mentions(spec_index):
        if key in enums:
            enums[key].mentions.setdefault(member, {})[place] = user
    wrong_members: set[str] = set()
    for key, enum in sorted(enums.items(), key=lambda entry: -entry[1].max_unknown_mention_count):
        unknown_members = [member for member in enum.unknown_members if member not in wrong_members]
        yield from _enum_findings(spec_index, key, enum, unknown_members[:MAX_SUGGESTIONS], wrong_members)


def _enums(spec_index: SpecIndex) -> dict[Key, _Enum]:
    enums: dict[Key, _Enum] = {}
    for variable in spec_index.spec.context:
        if variable.type.kind is Kind.ENUM:
            user, path = f"{USERS['context']} '{variable.name}'", f"context.{variable.name}.values"
            enums["context", variable.name] = _Enum(variable.type, variable.place, user, path)
    for algorithm in spec_index.spec.perception:
        for returned in algorithm.returns:
            if returned.type.kind is Kind.ENUM:
                user = f"returned value '{returned.name}' of algorithm '{algorithm.name}'"
                path = f"perception.{algorithm.name}.returns.{returned.name}.values"
                enums[(algorithm.name,), returned.name] = _Enum(returned.type, returned.place, user, path)
    return enums


def _enum_findings(
    spec_index: SpecIndex, key: Key, enum: _Enum, unknown_members: list[str], wrong_members: set[str]
) -> Iterator[Diagnostic]:
    """Yield findings about the members of one enum.

    Misspelt members are added to `wrong_members`, because they can be unknown members of other enums as well.
    """
    values = dict.fromkeys(enum.type.values)
    corrections: dict[str, tuple[str, ...]] = {}
    for member in values:
        pieces = tuple(member.split())
        if len(pieces) > 1 and member not in enum.mentions and any(piece in unknown_members for piece in pieces):
            corrections[member] = pieces
            yield _joined_members_finding(enum, member, pieces)
    split_members = {piece for pieces in corrections.values() for piece in pieces}
    use_counts = {
        member: len({place.span for place in enum.mentions[member]})
        for member in unknown_members
        if member not in split_members
    }
    unused_members = [member for member in values if member not in enum.mentions and member not in corrections]
    misspelt_members = (
        misspelt_declarations(use_counts, unused_members, values, spec_index.vocabulary, suggest)
        if use_counts and unused_members
        else {}
    )
    for name, member in misspelt_members.items():
        corrections[member] = (name,)
        wrong_members.add(member)
        yield _misspelt_member_finding(enum, member, name)
    if corrections:
        members = (corrected_member for member in values for corrected_member in corrections.get(member, (member,)))
        spec_index.corrections.members[key] = tuple(dict.fromkeys(members))


def _joined_members_finding(enum: _Enum, member: str, pieces: tuple[str, ...]) -> Diagnostic:
    place, pieces_text = enum.place_of(member), ", ".join(pieces)
    message = f"the member '{member}' of {enum.user} is not used, but its words are used as members"
    related = tuple(_related(enum, piece) for piece in pieces if piece in enum.mentions)
    fix = _replacement_fix(place, member, pieces_text)
    return finding(
        "unknown-member", message, place, path=enum.path, help=f"write '{pieces_text}'", related=related, fix=fix
    )


def _misspelt_member_finding(enum: _Enum, member: str, name: str) -> Diagnostic:
    place = enum.place_of(member)
    message = f"the member '{member}' of {enum.user} is not used, and '{name}', which is used, is not a member"
    fix = _replacement_fix(place, member, name)
    help = f"did you mean '{name}'?"
    return finding(
        "unknown-member", message, place, path=enum.path, help=help, related=(_related(enum, name),), fix=fix
    )


def _replacement_fix(place: Place, member: str, intended_member: str) -> Fix | None:
    """Return the fix that replaces a member; None if the member is written in quotes."""
    is_plain = place.span.end_column - place.span.column == len(member)
    return replacement_fix(place, member, intended_member, safe=False) if is_plain else None


def _related(enum: _Enum, member: str) -> Related:
    place, user = next(iter(enum.mentions[member].items()))
    return Related(f"'{member}' in {user}", place)


def _mentions(spec_index: SpecIndex) -> Iterator[tuple[Key, str, Place, str]]:
    """Yield, for every mention of a member, the enum, the member, the place and the element that mentions it."""
    for site in spec_index.sites:
        user = f"{USERS[site.owner[0]]} '{site.owner[1]}'"
        for key, member, node in _mentions_in_condition(spec_index, site):
            yield key, member, site.condition.place_of(node), user
    for algorithm in spec_index.spec.perception:
        for entry in algorithm.identifies:
            for case, _ in entry.by.cases if isinstance(entry.by, Members) else ():
                yield ("context", entry.variable.name), case.name, case.place, f"algorithm '{algorithm.name}'"


def _mentions_in_condition(spec_index: SpecIndex, site: Site) -> Iterator[tuple[Key, str, Node]]:
    tree = site.condition.tree
    assert tree is not None
    reads_returned_values = site.role in (Role.ACCEPT_WHEN, Role.IDENTIFIES)
    owner: Owner = (site.owner[1],) if reads_returned_values else "context"
    for one, other in ((one, other) for node in walk(tree) for _, one, other in own_comparisons(node)):
        for name_side, value_side in ((one, other), (other, one)):
            if isinstance(name_side, Name):
                yield from (
                    ((owner, name_side.name), leaf.value, leaf)
                    for leaf in _leaves(value_side)
                    if isinstance(leaf, Text)
                )
    if site.result is Result.VALUE and site.variable is not None:
        for leaf in _leaves(tree):
            if isinstance(leaf, Text):
                yield ("context", site.variable), leaf.value, leaf
            elif isinstance(leaf, Name):
                yield from _shared_enum_members(spec_index, site, (owner, leaf.name), leaf)


def _shared_enum_members(
    spec_index: SpecIndex, site: Site, read_key: Key, leaf: Name
) -> Iterator[tuple[Key, str, Node]]:
    """Yield the members of both enums if a returned enum, or another variable, becomes the value of a variable.

    Each member of one enum is yielded as a mention for the other enum.
    """
    variable = spec_index.variables.get(site.variable or "")
    algorithm = spec_index.algorithms.get(site.owner[1]) if site.owner[0] == "perception" else None
    readable_values = spec_index.spec.context if algorithm is None else algorithm.returns
    read_value = next((readable for readable in readable_values if readable.name == leaf.name), None)
    if variable is not None and read_value is not None and read_value.type.kind is variable.type.kind is Kind.ENUM:
        yield from ((("context", variable.name), member, leaf) for member in read_value.type.values)
        yield from ((read_key, member, leaf) for member in variable.type.values)


def _leaves(node: Node) -> Iterator[Node]:
    """Yield the expressions that can give the value: the node itself, or the alternatives of a choice or fallback."""
    if isinstance(node, Choice):
        yield from _leaves(node.then)
        yield from _leaves(node.otherwise)
    elif isinstance(node, Fallback):
        yield from _leaves(node.value)
        yield from _leaves(node.otherwise)
    else:
        yield node
