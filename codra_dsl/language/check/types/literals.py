"""Names that were probably intended as literals: members and texts without quotes, and words such as `yes`."""

from __future__ import annotations

from collections.abc import Sequence

from codra_dsl.language.check.conditions.conditions import CONTEXT_ROLES, KNOWLEDGE_ROLES, Role, Site
from codra_dsl.language.check.conditions.types import Types
from codra_dsl.language.check.index.fixes import quoting_fix, truth_fix
from codra_dsl.language.check.index.mentions import Mention
from codra_dsl.language.check.index.spec_index import SpecIndex
from codra_dsl.language.check.solver.values import own_comparisons
from codra_dsl.language.diagnostics import Fix
from codra_dsl.language.expression import Name, walk
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.load.yaml.fixes import corrected_truth_value
from codra_dsl.language.model import Condition, Kind

_WORDS_FOR_UNKNOWN = ("unknown", "undefined", "none", "nil")


@dataclass(frozen=True, slots=True)
class LiteralHelp:
    """The help for a name that was intended as a literal.

    Attributes:
        truth: `true` or `false` if the name was intended as this truth value; otherwise empty.
        condition: the condition that contains the name, if quotes around the name are the fix.
    """

    help: str
    truth: str = ""
    condition: Condition | None = None

    def fix(self, mentions: Sequence[Mention]) -> Fix | None:
        """Return the fix of all mentions of the name."""
        name = mentions[0].name
        if self.truth:
            return truth_fix(name, self.truth, [mention.place for mention in mentions])
        is_only_mention = self.condition is not None and len(mentions) == 1
        return quoting_fix(name, mentions[0].place, self.condition) if is_only_mention and self.condition else None


def intended_literal_help(spec_index: SpecIndex, site: Site, name: str) -> LiteralHelp | None:
    """Return the help for a name that was intended as a literal, such as a member without quotes, or `yes`.

    Return None if the name was probably not intended as a literal.
    """
    is_whole_condition = isinstance(site.condition.tree, Name)
    truth_value = corrected_truth_value(name)
    if truth_value is not None:
        if not is_whole_condition:
            return LiteralHelp(f"write '{truth_value}'", truth_value)
        return LiteralHelp(
            f"write '{truth_value}' including the quotes" if site.variable else f"write a condition: x == {truth_value}"
        )
    readable_types: Types = spec_index.returned_types[site.owner[1]] if site.owner[0] == "perception" else {}
    if site.role in KNOWLEDGE_ROLES:
        readable_types = {
            read_name.name: spec_index.declared_graph.name_type(read_name.name) for read_name in site.names
        }
    types = [
        readable_types.get(read_name.name) or spec_index.context_types.get(read_name.name) for read_name in site.names
    ]
    enum_values = [
        value_type.values
        for value_type in (*types, spec_index.wanted_type(site))
        if value_type is not None and value_type.kind is Kind.ENUM
    ]
    if not any(name in values for values in enum_values):
        return None
    if is_whole_condition:
        return LiteralHelp(f"write '\"{name}\"': YAML removes the outer quotes")
    return LiteralHelp(f'put the member in quotes: "{name}"', condition=site.condition)


def compared_literal_help(spec_index: SpecIndex, mention: Mention) -> str | None:
    """Return the help for an undeclared name that is compared as a literal, or is a member of some enum.

    Return None for other names.
    """
    site = mention.site
    if site is None or site.condition.tree is None:
        return None
    reads_context = site.role in CONTEXT_ROLES
    readable_types = spec_index.context_types if reads_context else _readable_types(spec_index, site)
    if isinstance(site.condition.tree, Name):
        owners = (
            name
            for name, value_type in readable_types.items()
            if value_type is not None and mention.name in value_type.values
        )
        owner = spec_index.owner_of_member.get(mention.name) if reads_context else next(owners, None)
        return f'write {owner} == "{mention.name}"' if owner else None
    side_pairs = (
        side_pair
        for node in walk(site.condition.tree)
        for _, *link in own_comparisons(node)
        for side_pair in (link, link[::-1])
    )
    opposite_names = [
        other.name
        for one, other in side_pairs
        if isinstance(one, Name) and isinstance(other, Name) and one.name == mention.name
    ]
    kinds = {value_type.kind for name in opposite_names if (value_type := readable_types.get(name)) is not None}
    if reads_context and mention.name.lower() in _WORDS_FOR_UNKNOWN:
        if opposite_names:
            return f"write not known({opposite_names[0]})"
        return "remove it: a value that no known input determines is unknown anyway"
    if kinds == {Kind.BOOL}:
        return "write true or false"
    return f'put the text in quotes: "{mention.name}"' if kinds == {Kind.STR} else None


def _readable_types(spec_index: SpecIndex, site: Site) -> Types:
    """Return the types of the names that can be read in a condition over results or in an expectation's condition."""
    if site.role is Role.MONITOR:
        return {site.variable or "": spec_index.wanted_type(site)}
    return spec_index.returned_types[site.owner[1]]
