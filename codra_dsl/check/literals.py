"""Names that are meant as literals: members and texts without quotes, and words that mean true or false elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from codra_dsl.check.conditions import OVER_CONTEXT, OVER_KNOWLEDGE, Role, Site
from codra_dsl.check.fixes import quoting, truth
from codra_dsl.check.mentions import Mention
from codra_dsl.check.outcomes import links
from codra_dsl.check.scope import Scope
from codra_dsl.check.types import Types
from codra_dsl.diagnostics import Fix
from codra_dsl.expression import Name, Node, walk
from codra_dsl.load.fixes import truth_meant
from codra_dsl.model import Condition, Kind


@dataclass(frozen=True, slots=True)
class Literal:
    """The way out where a name is meant as a literal. `truth` is what it means where that is true or false."""

    help: str
    truth: str = ""
    condition: Condition | None = None

    def fix(self, mentions: Sequence[Mention]) -> Fix | None:
        """Return the fix of all mentions of the name."""
        name = mentions[0].name
        if self.truth:
            return truth(name, self.truth, [mention.place for mention in mentions])
        alone = self.condition is not None and len(mentions) == 1
        return quoting(name, mentions[0].place, self.condition) if alone and self.condition else None


def literal_meant(scope: Scope, site: Site, name: str) -> Literal | None:
    """Return the way out where a name is meant as a literal: a member without quotes, or `yes`."""
    alone = isinstance(site.condition.tree, Name)
    meant = truth_meant(name)
    if meant is not None:
        if not alone:
            return Literal(f"write '{meant}'", meant)
        return Literal(f"write '{meant}', quotes and all" if site.variable else f"write a condition: x == {meant}")
    seen: Types = scope.returned_types[site.owner[1]] if site.owner[0] == "perception" else {}
    if site.role in OVER_KNOWLEDGE:
        seen = {each.name: scope.world.read_type(each.name) for each in site.names}
    types = [seen.get(each.name) or scope.context_types.get(each.name) for each in site.names]
    members = [each.values for each in (*types, scope.wanted(site)) if each is not None and each.kind is Kind.ENUM]
    if not any(name in each for each in members):
        return None
    if alone:
        return Literal(f"write '\"{name}\"': YAML takes the outer quotes away")
    return Literal(f'members stand in quotes: "{name}"', condition=site.condition)


def literal_compared(scope: Scope, mention: Mention) -> str | None:
    """Return the way out where a name that means nothing is compared as a literal, or is a member of some enum."""
    site = mention.site
    if site is None or site.condition.tree is None:
        return None
    in_context = site.role in OVER_CONTEXT
    seen = scope.context_types if in_context else _seen_by(scope, site)
    if isinstance(site.condition.tree, Name):
        owners = (name for name, each in seen.items() if each is not None and mention.name in each.values)
        owner = scope.owner_of_member.get(mention.name) if in_context else next(owners, None)
        return f'write {owner} == "{mention.name}"' if owner else None
    sides = (side for node in walk(site.condition.tree) for _, *link in links(node) for side in (link, link[::-1]))
    beside = (other.name for one, other in sides if isinstance(other, Name) and _is(one, mention.name))
    kinds = {each.kind for name in beside if (each := seen.get(name)) is not None}
    if kinds == {Kind.BOOL}:
        return "write true or false"
    return f'texts stand in quotes: "{mention.name}"' if kinds == {Kind.STR} else None


def _seen_by(scope: Scope, site: Site) -> Types:
    """Return the types of what a condition over results, or of an expectation, can see."""
    if site.role is Role.MONITOR:
        return {site.variable or "": scope.wanted(site)}
    return scope.returned_types[site.owner[1]]


def _is(node: Node, name: str) -> bool:
    return isinstance(node, Name) and node.name == name
