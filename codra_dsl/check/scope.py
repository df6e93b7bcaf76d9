"""What every check looks at: the spec, with its names in tables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import TypeVar

from codra_dsl import graph
from codra_dsl.check.conditions import OF_LOOPS, OVER_KNOWLEDGE, Judgement, Role, Site, judge, parts_of, sites
from codra_dsl.check.knowledge.world import World
from codra_dsl.check.mape.book import RuleBook
from codra_dsl.check.meant import Meant
from codra_dsl.check.types import Type, Types, declared_type
from codra_dsl.check.words import NOUNS
from codra_dsl.diagnostics import suggest
from codra_dsl.expression import Name, Text, names_in, walk
from codra_dsl.load.misspelt import Vocabulary
from codra_dsl.load.names import is_identifier
from codra_dsl.model import (
    Agent,
    Algorithm,
    AnyName,
    Condition,
    Members,
    ObserverSetting,
    Reference,
    Resource,
    Skill,
    Spec,
    Variable,
)
from codra_dsl.trees.named import Read

Named = TypeVar("Named", Variable, Algorithm, Skill, ObserverSetting, Resource, Agent)

MAIN_EXECUTION = "main_execution"
OBSERVER = "observer"

UNDER_KNOWLEDGE = frozenset({"types", "nodes", "edges", "tasks"})
"""The sections that stand together under `knowledge`, which begins the paths of their findings."""

MAX_SUGGESTIONS = 25
"""So many names are compared with all others; from then on an unknown name is reported without a suggestion."""

TYPE_KEYS = ("type", "unit", "values")
"""The keys that make up the type of a variable or returned value."""

NEED_KEYS = ("observable_when", "given")
"""The keys that say what an algorithm needs."""


@dataclass(frozen=True, slots=True)
class Faults:
    """What earlier phases found wrong, so that later ones keep quiet about it.

    Attributes:
        elements: (section, name) of elements with an error.
        meant: names that an unknown name most likely means: they count as used and as identified.
    """

    elements: frozenset[tuple[str, str]] = frozenset()
    meant: frozenset[str] = frozenset()

    def sound(self, section: str, name: str) -> bool:
        """Return whether nothing has been found wrong with an element."""
        return (section, name) not in self.elements


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Algorithms that share variables, directly or through others: alternatives in one tree.

    Attributes:
        algorithms: by rank, then name.
        variables: what they identify, in their order.
    """

    algorithms: tuple[Algorithm, ...]
    variables: tuple[str, ...]

    @property
    def settled(self) -> bool:
        """Whether ranks put the algorithms in an order."""
        return len({algorithm.rank for algorithm in self.algorithms}) == len(self.algorithms)

    @property
    def beyond_first(self) -> tuple[str, ...]:
        """Return the variables that the first algorithm does not identify."""
        first = {entry.variable.name for entry in self.algorithms[0].identifies}
        return tuple(name for name in self.variables if name not in first)


@dataclass(frozen=True)
class Scope:
    """A spec with its names and conditions in tables. Each table is made when it is first asked for.

    Attributes:
        forests: the trees that the spec names, as their files say.
        meant_names: what misspelt names mean, as it is found out.
    """

    spec: Spec
    forests: Mapping[str, Read] = field(default_factory=dict, compare=False)
    meant_names: Meant = field(default_factory=Meant, compare=False)
    _names: dict[str, frozenset[str]] = field(default_factory=dict, compare=False)
    _near: dict[tuple[str, str], str | None] = field(default_factory=dict, compare=False)
    _lowered: dict[tuple[int, int], str] = field(default_factory=dict, compare=False)

    @cached_property
    def variables(self) -> Mapping[str, Variable]:
        """The declared context-variables C_M, by name."""
        return _by_name(self.spec.context)

    @cached_property
    def algorithms(self) -> Mapping[str, Algorithm]:
        """The perception algorithms by name."""
        return _by_name(self.spec.perception)

    @cached_property
    def resources(self) -> Mapping[str, Resource]:
        """The resources by name."""
        return _by_name(self.spec.resources)

    @cached_property
    def agents(self) -> Mapping[str, Agent]:
        """The agents by name."""
        return _by_name(self.spec.agents)

    @cached_property
    def world(self) -> World:
        """The knowledge graph."""
        return World(self.spec)

    @cached_property
    def book(self) -> RuleBook:
        """The fuzzy rules."""
        return RuleBook(self.spec)

    @cached_property
    def producers(self) -> Mapping[str, tuple[str, ...]]:
        """For each variable that has algorithms: their names by rank, then name."""
        found: dict[str, list[Algorithm]] = {}
        for algorithm in self.algorithms.values():
            for name in dict.fromkeys(entry.variable.name for entry in algorithm.identifies):
                found.setdefault(name, []).append(algorithm)
        ranked = {
            name: sorted(algorithms, key=lambda each: (each.rank, each.name)) for name, algorithms in found.items()
        }
        return {name: tuple(each.name for each in algorithms) for name, algorithms in ranked.items()}

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """The groups of alternatives, in file order; most have one algorithm."""
        shares: dict[str, list[str]] = {name: [] for name in self.algorithms}
        for names in self.producers.values():
            for one, other in pairwise(names):
                shares[one].append(other)
                shares[other].append(one)
        found: dict[str, Group] = {}
        for name in self.algorithms:
            if name not in found:
                names = graph.closure(shares, [name])
                found |= dict.fromkeys(names, self._group(names))
        return tuple(dict.fromkeys(found.values()))

    @cached_property
    def group_of(self) -> Mapping[str, Group]:
        """The group that identifies each variable."""
        return {name: group for group in self.groups for name in group.variables}

    @cached_property
    def claims(self) -> Mapping[str, tuple[ObserverSetting, Reference]]:
        """For each variable that `observers` names: the first entry that does, and where."""
        found: dict[str, tuple[ObserverSetting, Reference]] = {}
        for setting in self.spec.observers:
            for reference in setting.identifies:
                found.setdefault(reference.name, (setting, reference))
        return found

    @cached_property
    def _sections(self) -> Mapping[str, frozenset[str]]:
        return {
            "context": frozenset(name for name, each in self.variables.items() if each.posed is None),
            "resources": frozenset(self.resources),
            "agents": frozenset(self.agents),
            **self.world.sections,
            "skills": frozenset(skill.name for skill in self.spec.skills),
            "perception": frozenset(self.algorithms),
            "observers": frozenset(observer.name for observer in self.spec.observers),
            "metrics": frozenset(metric.name for metric in self.spec.metrics),
            "actions": frozenset(action.name for action in self.spec.actions),
            "adaptation": frozenset(each.name for each in self.spec.adaptation),
            "trees": frozenset(tree.name for tree in self.spec.trees),
            "loops": frozenset(loop.name for loop in self.spec.loops),
        }

    def names(self, section: str) -> frozenset[str]:
        """Return the names of a section's elements, and those of elements that could not be read."""
        if section not in self._names:
            unread = self.spec.damaged.get(section, frozenset())
            self._names[section] = self._sections[section].union(name for name in unread if name.isidentifier())
        return self._names[section]

    def declares(self, section: str, name: str) -> bool:
        """Return whether a section has such an element, be it damaged."""
        return name in self._sections[section] or name in self.spec.damaged.get(section, ())

    def readable(self, section: str, name: str, *keys: str) -> bool:
        """Return whether some keys of an element could be read, all of them."""
        return self.spec.damaged_keys.get((section, name), frozenset()).isdisjoint(keys)

    def lost(self, section: str, *keys: str) -> bool:
        """Return whether elements of a section, or some keys of one, could not be read: nobody knows what they say."""
        unread = self.spec.damaged.get(section, frozenset())
        if isinstance(unread, AnyName) or not self._sections[section].issuperset(unread):
            return True
        return any(not self.readable(section, name, *keys) for name in unread)

    def nameless(self, section: str) -> int:
        """Return how many elements of a section have names that no element can have, so that nobody knows them."""
        return sum(1 for name in self.spec.damaged.get(section, ()) if not is_identifier(name))

    @cached_property
    def strangers(self) -> frozenset[str]:
        """The names that algorithms identify or need, and skills and observers name, though nothing declares them."""
        named = [entry.variable for algorithm in self.spec.perception for entry in algorithm.identifies]
        named += [reference for algorithm in self.spec.perception for reference in algorithm.given]
        named += [reference for setting in self.spec.observers for reference in setting.identifies]
        found = {reference.name for reference in named}
        found.update(name for skill in self.spec.skills for name in watched_by(skill))
        found.update(name for names in self.needs.values() for name in names)
        return frozenset(name for name in found if name not in self.variables and not self.declares("context", name))

    @cached_property
    def owner_of_member(self) -> Mapping[str, str]:
        """For each member of a context-variable's enum, a variable that has it."""
        return {member: variable.name for variable in self.spec.context[::-1] for member in variable.type.values}

    @cached_property
    def parameters(self) -> frozenset[str]:
        """The names of all parameters of templates, but for the name of the use."""
        return frozenset(each.name for template in self.spec.templates for each in template.parameters)

    @cached_property
    def vocabulary(self) -> Vocabulary:
        """The words of all that the spec declares, and of its texts."""
        return Vocabulary(_texts(self.spec))

    @cached_property
    def used_values(self) -> Mapping[str, frozenset[str]]:
        """For each algorithm the names in all conditions over what it returns."""
        found: dict[str, set[str]] = {name: set() for name in self.algorithms}
        for site in self.sites:
            if site.role in (Role.ACCEPT_WHEN, Role.IDENTIFIES):
                found[site.owner[1]].update(name.name for name in site.names)
        return {name: frozenset(names) for name, names in found.items()}

    def other_kind(self, name: str, wanted: str) -> str | None:
        """Return what a name is, if it is something else than an element of the section `wanted`."""
        return next((NOUNS[section] for section in NOUNS if section != wanted and self.declares(section, name)), None)

    def nearest(self, name: str, kind: str, candidates: Iterable[str]) -> str | None:
        """Return the candidate that an unknown name most likely means; `kind` tells sets of candidates apart."""
        if (name, kind) not in self._near:
            limited = len(self._near) >= MAX_SUGGESTIONS
            self._near[name, kind] = None if limited else suggest(name, candidates)
        return self._near[name, kind]

    @cached_property
    def context_types(self) -> Types:
        """The type of each context-variable, and of what conditions ask of poses; None where it is declared wrong."""
        posed = (each.posed.tree for each in self.spec.context if each.posed is not None)
        asked = {name.name: self.world.read_type(name.name) for tree in posed for name in names_in(tree)}
        unread = dict.fromkeys(sorted(self.spec.damaged.get("context", ())), None)
        return (
            unread
            | asked
            | {
                name: declared_type(variable.type, variable.valid_for_s)
                if self.readable("context", name, *TYPE_KEYS)
                else None
                for name, variable in self.variables.items()
            }
        )

    @cached_property
    def returned_types(self) -> Mapping[str, Types]:
        """For each algorithm, the type of each value that it returns; None where its declaration is wrong."""
        found: dict[str, Types] = {}
        alike: dict[
            tuple[object, ...], Types
        ] = {}  # so that what is judged over the same types can be told by identity
        for name, algorithm in self.algorithms.items():
            types = {
                each.name: declared_type(each.type)
                if self.readable("perception", name, "returns", f"returns.{each.name}")
                else None
                for each in algorithm.returns
            }
            found[name] = alike.setdefault(
                tuple((returned, id(declared)) for returned, declared in types.items()), types
            )
        return found

    @cached_property
    def sites(self) -> tuple[Site, ...]:
        """Every condition of the spec that could be read."""
        return tuple(sites(self.spec))

    @cached_property
    def needs(self) -> Mapping[str, tuple[str, ...]]:
        """For each algorithm, C_Oi: the context-variables that it reads before it starts, each once, in order."""
        found: dict[str, list[str]] = {name: [] for name in self.algorithms}
        for site in self.sites:
            if site.role is Role.OBSERVABLE_WHEN:
                found[site.owner[1]] += (name.name for name in site.names)
        for name, algorithm in self.algorithms.items():
            found[name] += (reference.name for reference in algorithm.given)
        return {name: tuple(dict.fromkeys(names)) for name, names in found.items()}

    @cached_property
    def trees(self) -> Mapping[str, tuple[str, ...]]:
        """For each variable that has algorithms: what is in force when it is, as its tree identifies or needs it."""
        found: dict[str, tuple[str, ...]] = {}
        for group in self.groups:
            needs = dict.fromkeys(name for algorithm in group.algorithms for name in self.needs[algorithm.name])
            found |= dict.fromkeys(group.variables, (*group.variables, *needs))
        for setting in self.spec.observers:
            joined = tuple(reference.name for reference in setting.identifies)
            found |= {name: (*found[name], *joined) for name in joined if name in found}
        return found

    @cached_property
    def decisions(self) -> tuple[str, ...]:
        """The variables that decisions are based on, where Algorithm 2 starts (P1, its line 3)."""
        if not self.spec.skills:
            return tuple(name for name in self.variables if name in self.producers)
        named = [name for skill in self.spec.skills for name in watched_by(skill)]
        named += sorted(name for name in self.read_by_loops | self.waking if name in self.producers)
        return tuple(name for name in dict.fromkeys(named) if name in self.variables)

    @cached_property
    def read_by_loops(self) -> frozenset[str]:
        """The variables that rules and conditions of loops read, and those whose rates they read."""
        conditions = {name.name for site in self.sites if site.role in OF_LOOPS for name in site.names}
        return self.book.followed(conditions)

    @cached_property
    def waking(self) -> frozenset[str]:
        """The variables that wake agents."""
        names = (name.name for site in self.sites if site.role is Role.WAKES for name in site.names)
        read = (self.world.read(name) for name in names)
        return frozenset(thing.name for thing in read if thing is not None and thing.section == "context")

    @cached_property
    def reached(self) -> frozenset[str]:
        """The variables in force when all decisions are declared; to be asked when all names have been looked at."""
        return frozenset(graph.closure(self.trees, (*self.decisions, *sorted(self.meant))))

    @cached_property
    def mentioned(self) -> frozenset[str]:
        """Every name and every quoted text that something refers to: what is declared so is hardly misspelt there."""
        found = {source.name for variable in self.spec.context for source in variable.sources}
        for algorithm in self.spec.perception:
            found.update(usage.resource.name for usage in algorithm.uses)
            found.update(reference.name for reference in algorithm.given)
            found.update(entry.variable.name for entry in algorithm.identifies)
            cases = (entry.by.cases for entry in algorithm.identifies if isinstance(entry.by, Members))
            found.update(member.name for several in cases for member, _ in several)
        for skill in self.spec.skills:
            found.update(name for name in watched_by(skill))
            found.update(reference.name for reference in skill.changes)
        for observer in self.spec.observers:
            found.update(reference.name for reference in observer.identifies)
        for tree in (site.condition.tree for site in self.sites):
            parts = walk(tree) if tree is not None else ()
            found.update(
                part.name if isinstance(part, Name) else part.value for part in parts if isinstance(part, Name | Text)
            )
        return frozenset(found)

    @cached_property
    def judgements(self) -> Mapping[int, Judgement]:
        """What each condition is, by the identity of the condition."""
        judged: dict[tuple[object, ...], Judgement] = {}
        return {id(site.condition): self._judge(site, judged) for site in self.sites}

    def shape_over_results(self, algorithm: Algorithm, faults: Faults) -> object:
        """Return what an algorithm makes of its result, but for names and places: equal for those that do the same.

        Trees and types are told by identity: conditions that read alike share their trees, and what is declared alike
        shares its type.
        """
        accepted = tuple([id(condition.tree) for condition in algorithm.accept_when])
        identified = tuple(
            [
                (
                    type(entry.by),
                    id(self.context_types.get(entry.variable.name)),
                    entry.variable.name in self.variables and faults.sound("context", entry.variable.name),
                    *[id(condition.tree) for condition in parts_of(entry)],
                )
                for entry in algorithm.identifies
            ]
        )
        optional = tuple([each.optional for each in algorithm.returns])
        return id(self.returned_types[algorithm.name]), accepted, identified, optional

    def python(self, condition: Condition, wanted: Type | None) -> str:
        """Return a sound condition as Python text, a number in the unit of what it is given to."""
        judgement = self.judgements[id(condition)]
        key = (id(judgement.typed), id(wanted))  # conditions that are judged alike share what they are
        if key not in self._lowered:
            self._lowered[key] = judgement.python(wanted)
        return self._lowered[key]

    def judgement(self, condition: Condition) -> Judgement | None:
        """Return what a condition is, or None if it could not be read."""
        return self.judgements.get(id(condition))

    def wanted(self, site: Site) -> Type | None:
        """Return the type of the context-variable that a condition gives its value or that it is about."""
        return None if site.variable is None else self.context_types.get(site.variable)

    @property
    def meant(self) -> frozenset[str]:
        """The context-variables that names found unknown so far most likely mean."""
        return frozenset(near for (_, kind), near in self._near.items() if near is not None and kind == "context")

    def _group(self, names: Iterable[str]) -> Group:
        ranked = tuple(sorted((self.algorithms[name] for name in names), key=lambda each: (each.rank, each.name)))
        entries = (entry for algorithm in ranked for entry in algorithm.identifies)
        return Group(ranked, tuple(dict.fromkeys(entry.variable.name for entry in entries)))

    def _judge(self, site: Site, judged: dict[tuple[object, ...], Judgement]) -> Judgement:
        """Return what a condition is; `judged` keeps those that are sound for others with the same tree and types."""
        tree = site.condition.tree
        assert tree is not None
        wanted = self.wanted(site)
        if site.role is Role.OBSERVABLE_WHEN or site.role in OF_LOOPS:
            seen = self.context_types
        elif site.role in OVER_KNOWLEDGE:
            seen = {
                each.name: self.context_types.get(each.name, self.world.read_type(each.name)) for each in site.names
            }
        elif site.role is Role.MONITOR and site.variable is not None:
            seen = {site.variable: wanted}
        else:
            seen = self.returned_types[site.owner[1]]
        types = (id(seen.get(name.name)) for name in site.names)
        key = (id(tree), site.role, site.result, id(wanted), *types)
        sound = judged.get(key)
        if sound is not None:
            return Judgement(site, sound.typed, ())
        judgement = judge(site, tree, seen, wanted)
        if not judgement.problems:
            judged[key] = judgement
        return judgement


def watched_by(skill: Skill) -> Iterator[str]:
    """Yield the variables that a skill previews, then those that it monitors."""
    yield from (reference.name for reference in skill.preview)
    yield from (expectation.variable.name for expectation in skill.monitor)


def _by_name(elements: Iterable[Named]) -> Mapping[str, Named]:
    """Return elements by name; where a name stands twice, which `load` reports, the first counts."""
    found: dict[str, Named] = {}
    for element in elements:
        found.setdefault(element.name, element)
    return found


def _texts(spec: Spec) -> Iterator[str]:
    for variable in spec.context:
        yield from (variable.name, variable.label, variable.description, *variable.type.values)
    for algorithm in spec.perception:
        yield from (algorithm.name, algorithm.call, *(name for name, _ in algorithm.parameters))
        yield from (text for _, text in algorithm.parameters if isinstance(text, str))
        for returned in algorithm.returns:
            yield from (returned.name, *returned.type.values)
    yield from (skill.name for skill in spec.skills)
    yield from (setting.name for setting in spec.observers)
    yield from (resource.name for resource in spec.resources)
    yield from (agent.name for agent in spec.agents)
