"""The input of every check: the spec, with its names in tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import field
from functools import cached_property
from itertools import pairwise
from typing import TypeVar

from codra_dsl.language import graph
from codra_dsl.language.behavior_trees.named import ReadResult
from codra_dsl.language.check.conditions.conditions import (
    CONTEXT_ROLES,
    KNOWLEDGE_ROLES,
    LOOP_ROLES,
    Judgement,
    Role,
    Site,
    judge,
    parts_of,
    sites,
)
from codra_dsl.language.check.conditions.types import Type, Types, declared_type
from codra_dsl.language.check.index.corrections import Corrections
from codra_dsl.language.check.index.graph_schema import DeclaredGraph
from codra_dsl.language.check.index.parsed_rules import ParsedRules
from codra_dsl.language.check.index.words import NOUNS, texts_of
from codra_dsl.language.diagnostics import suggest
from codra_dsl.language.expression import Name, Node, Text, is_identifier, names_in, spelt_out, variables_in, walk
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.load.schema.misspelt_names import Vocabulary
from codra_dsl.language.model import (
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

Named = TypeVar("Named", Variable, Algorithm, Skill, ObserverSetting, Resource, Agent)

MAIN_EXECUTION = "main_execution"
OBSERVER = "observer"

KNOWLEDGE_SECTIONS = frozenset({"types", "nodes", "edges", "tasks"})
"""The sections inside `knowledge`. The paths of findings about their elements begin with `knowledge`."""

MAX_SUGGESTIONS = 25
"""The maximum number of unknown names for which a similar name is searched. Further unknown names get no suggestion."""

TYPE_KEYS = ("type", "unit", "values")
"""The keys that define the type of a variable or returned value."""

NEED_KEYS = ("observable_when", "given")
"""The keys that define the needs of an algorithm."""


@dataclass(frozen=True, slots=True)
class FaultyElements:
    """The elements with errors in earlier phases. Later phases report nothing more about these elements.

    Attributes:
        elements: the section and the name of each element with an error.
        suggested_variables: the variables suggested for unknown names. Checks treat them as used and identified.
    """

    elements: frozenset[tuple[str, str]] = frozenset()
    suggested_variables: frozenset[str] = frozenset()

    def is_sound(self, section: str, name: str) -> bool:
        """Return whether an element has no reported error."""
        return (section, name) not in self.elements


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Alternatives in one tree: algorithms that share identified variables, directly or through other algorithms.

    Attributes:
        algorithms: the algorithms, sorted by rank, then by name.
        variables: the variables that the algorithms identify, in the order of the algorithms.
    """

    algorithms: tuple[Algorithm, ...]
    variables: tuple[str, ...]

    @property
    def has_distinct_ranks(self) -> bool:
        """Whether the ranks of the algorithms are all different."""
        return len({algorithm.rank for algorithm in self.algorithms}) == len(self.algorithms)

    @property
    def variables_beyond_first(self) -> tuple[str, ...]:
        """Return the variables that the first algorithm does not identify."""
        first_variables = {entry.variable.name for entry in self.algorithms[0].identifies}
        return tuple(name for name in self.variables if name not in first_variables)


@dataclass(frozen=True)
class SpecIndex:
    """A spec with its names and conditions in tables. Each table is built on first use.

    Attributes:
        forests: the contents of the tree files that the spec names.
        corrections: the intended names for misspelt names, collected while checks run.
    """

    spec: Spec
    forests: Mapping[str, ReadResult] = field(default_factory=dict, compare=False)
    corrections: Corrections = field(default_factory=Corrections, compare=False)
    _names: dict[str, frozenset[str]] = field(default_factory=dict, compare=False)
    _near_names: dict[tuple[str, str], str | None] = field(default_factory=dict, compare=False)
    _python_texts: dict[tuple[int, int], str] = field(default_factory=dict, compare=False)

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
    def declared_graph(self) -> DeclaredGraph:
        """The declared knowledge graph."""
        return DeclaredGraph(self.spec)

    @cached_property
    def parsed_rules(self) -> ParsedRules:
        """The parsed fuzzy rules."""
        return ParsedRules(self.spec)

    @cached_property
    def producers(self) -> Mapping[str, tuple[str, ...]]:
        """For each variable that algorithms identify, the names of these algorithms, sorted by rank, then by name."""
        algorithms_by_variable: dict[str, list[Algorithm]] = {}
        for algorithm in self.algorithms.values():
            for name in dict.fromkeys(entry.variable.name for entry in algorithm.identifies):
                algorithms_by_variable.setdefault(name, []).append(algorithm)
        ranked_lists = {
            name: sorted(algorithms, key=lambda algorithm: (algorithm.rank, algorithm.name))
            for name, algorithms in algorithms_by_variable.items()
        }
        return {name: tuple(algorithm.name for algorithm in algorithms) for name, algorithms in ranked_lists.items()}

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """The groups of alternatives, in file order. Most groups have only one algorithm."""
        alternatives: dict[str, list[str]] = {name: [] for name in self.algorithms}
        for names in self.producers.values():
            for one, other in pairwise(names):
                alternatives[one].append(other)
                alternatives[other].append(one)
        group_by_algorithm: dict[str, Group] = {}
        for name in self.algorithms:
            if name not in group_by_algorithm:
                names = graph.closure(alternatives, [name])
                group_by_algorithm |= dict.fromkeys(names, self._group(names))
        return tuple(dict.fromkeys(group_by_algorithm.values()))

    @cached_property
    def group_of(self) -> Mapping[str, Group]:
        """A mapping from each variable to the group that identifies it."""
        return {name: group for group in self.groups for name in group.variables}

    @cached_property
    def claims(self) -> Mapping[str, tuple[ObserverSetting, Reference]]:
        """For each variable under `observers`, the first entry that contains the variable, and the reference there."""
        first_claims: dict[str, tuple[ObserverSetting, Reference]] = {}
        for setting in self.spec.observers:
            for reference in setting.identifies:
                first_claims.setdefault(reference.name, (setting, reference))
        return first_claims

    @cached_property
    def _sections(self) -> Mapping[str, frozenset[str]]:
        return {
            "context": frozenset(name for name, variable in self.variables.items() if variable.pose_condition is None),
            "resources": frozenset(self.resources),
            "agents": frozenset(self.agents),
            **self.declared_graph.sections,
            "skills": frozenset(skill.name for skill in self.spec.skills),
            "perception": frozenset(self.algorithms),
            "observers": frozenset(observer.name for observer in self.spec.observers),
            "metrics": frozenset(metric.name for metric in self.spec.metrics),
            "actions": frozenset(action.name for action in self.spec.actions),
            "adaptation": frozenset(adaptation.name for adaptation in self.spec.adaptation),
            "trees": frozenset(tree.name for tree in self.spec.trees),
            "loops": frozenset(loop.name for loop in self.spec.loops),
        }

    def names(self, section: str) -> frozenset[str]:
        """Return the names of a section's elements, including elements that could not be read."""
        if section not in self._names:
            damaged_names = self.spec.damaged.get(section, frozenset())
            self._names[section] = self._sections[section].union(name for name in damaged_names if name.isidentifier())
        return self._names[section]

    def declares(self, section: str, name: str) -> bool:
        """Return whether a section has an element with this name, even if the element is damaged."""
        return name in self._sections[section] or name in self.spec.damaged.get(section, ())

    def is_readable(self, section: str, name: str, *keys: str) -> bool:
        """Return whether all these keys of an element could be read."""
        return (section, name) not in self.spec.damaged_keys or self.spec.damaged_keys[section, name].isdisjoint(keys)

    def has_damage(self, section: str, *keys: str) -> bool:
        """Return whether some elements of a section, or one of these keys of an element, could not be read."""
        damaged_names = self.spec.damaged.get(section, frozenset())
        if isinstance(damaged_names, AnyName) or not self._sections[section].issuperset(damaged_names):
            return True
        return any(not self.is_readable(section, name, *keys) for name in damaged_names)

    def unnamed_element_count(self, section: str) -> int:
        """Return how many elements of a section have invalid names, so that their intended names are unknown."""
        return sum(1 for name in self.spec.damaged.get(section, ()) if not is_identifier(name))

    @cached_property
    def undeclared_names(self) -> frozenset[str]:
        """Undeclared variables that algorithms, skills, observers and rates name."""
        references = [entry.variable for algorithm in self.spec.perception for entry in algorithm.identifies]
        references += [reference for algorithm in self.spec.perception for reference in algorithm.given]
        references += [reference for setting in self.spec.observers for reference in setting.identifies]
        references += [variable.rate.of for variable in self.spec.context if variable.rate is not None]
        referenced_names = {reference.name for reference in references}
        referenced_names.update(name for skill in self.spec.skills for name in skill.watched_variables)
        referenced_names.update(name for names in self.needs.values() for name in names)
        return frozenset(
            name for name in referenced_names if name not in self.variables and not self.declares("context", name)
        )

    @cached_property
    def owner_of_member(self) -> Mapping[str, str]:
        """For each member of an enum, a context-variable with this member."""
        return {member: variable.name for variable in self.spec.context[::-1] for member in variable.type.values}

    @cached_property
    def parameters(self) -> frozenset[str]:
        """The names of all declared parameters of templates; `instance`, which every template has, is not included."""
        return frozenset(parameter.name for template in self.spec.templates for parameter in template.parameters)

    @cached_property
    def vocabulary(self) -> Vocabulary:
        """The words of all declared names and texts of the spec."""
        return Vocabulary(texts_of(self.spec))

    @cached_property
    def used_values(self) -> Mapping[str, frozenset[str]]:
        """For each algorithm, the names in all conditions over its returned values."""
        names_by_algorithm: dict[str, set[str]] = {name: set() for name in self.algorithms}
        for site in self.sites:
            if site.role in (Role.ACCEPT_WHEN, Role.IDENTIFIES):
                names_by_algorithm[site.owner[1]].update(name.name for name in site.names)
        return {name: frozenset(names) for name, names in names_by_algorithm.items()}

    def kind_elsewhere(self, name: str, section: str) -> str | None:
        """Return the kind of an element with this name in another section; None if there is none."""
        return next((noun for other, noun in NOUNS.items() if other != section and self.declares(other, name)), None)

    def nearest_name(self, name: str, kind: str, candidates: Iterable[str]) -> str | None:
        """Return the most likely candidate for an unknown name. `kind` identifies the candidates in the cache."""
        if (name, kind) not in self._near_names:
            is_limit_reached = len(self._near_names) >= MAX_SUGGESTIONS
            self._near_names[name, kind] = None if is_limit_reached else suggest(name, candidates)
        return self._near_names[name, kind]

    @cached_property
    def context_types(self) -> Types:
        """The type of each context-variable, and of each name in a pose condition; None if the declaration is wrong."""
        trees = (condition.tree for condition in self.spec.pose_conditions)
        pose_types = {name.name: self.declared_graph.name_type(name.name) for tree in trees for name in names_in(tree)}
        damaged_types = dict.fromkeys(sorted(self.spec.damaged.get("context", ())), None)
        return (
            damaged_types
            | pose_types
            | {
                name: declared_type(variable.type, variable.valid_for_s)
                if self.is_readable("context", name, *TYPE_KEYS)
                else None
                for name, variable in self.variables.items()
            }
        )

    @cached_property
    def returned_types(self) -> Mapping[str, Types]:
        """For each algorithm, the type of each value that it returns; None if the value's declaration is wrong."""
        types_by_algorithm: dict[str, Types] = {}
        shared_types: dict[tuple[object, ...], Types] = {}  # equal types share one mapping, so `id` can compare them
        for name, algorithm in self.algorithms.items():
            types = {
                returned.name: declared_type(returned.type)
                if self.is_readable("perception", name, "returns", f"returns.{returned.name}")
                else None
                for returned in algorithm.returns
            }
            types_by_algorithm[name] = shared_types.setdefault(
                tuple((returned, id(declared)) for returned, declared in types.items()), types
            )
        return types_by_algorithm

    @cached_property
    def sites(self) -> tuple[Site, ...]:
        """Every condition of the spec that could be parsed, except patterns that are paths."""
        return tuple(sites(self.spec))

    @cached_property
    def needs(self) -> Mapping[str, tuple[str, ...]]:
        """For each algorithm, C_Oi: the context-variables that it reads before it starts, without repetitions."""
        names_by_algorithm: dict[str, list[str]] = {name: [] for name in self.algorithms}
        for site in self.sites:
            if site.role is Role.OBSERVABLE_WHEN:
                names_by_algorithm[site.owner[1]] += (name.name for name in site.names)
        for name, algorithm in self.algorithms.items():
            names_by_algorithm[name] += (reference.name for reference in algorithm.given)
        return {name: tuple(dict.fromkeys(names)) for name, names in names_by_algorithm.items()}

    @cached_property
    def derived_inputs(self) -> Mapping[str, tuple[str, ...]]:
        """For each derived variable, the variables that its expression reads, without repetitions."""
        derivations = ((variable.name, variable.derived) for variable in self.variables.values())
        return {name: variables_in(derived.tree) for name, derived in derivations if derived is not None}

    @cached_property
    def tree_variables(self) -> Mapping[str, tuple[str, ...]]:
        """For each variable with algorithms, all variables that its tree identifies or needs; the inputs of others."""
        names_in_force = {name: (name, *inputs) for name, inputs in self.derived_inputs.items()}
        for group in self.groups:
            needs = dict.fromkeys(name for algorithm in group.algorithms for name in self.needs[algorithm.name])
            names_in_force |= dict.fromkeys(group.variables, (*group.variables, *needs))
        for setting in self.spec.observers:
            joined_names = tuple(reference.name for reference in setting.identifies)
            names_in_force |= {
                name: (*names_in_force[name], *joined_names) for name in joined_names if name in names_in_force
            }
        return names_in_force

    @cached_property
    def decisions(self) -> tuple[str, ...]:
        """The variables that decisions are based on. Algorithm 2 of P1 starts from these variables (line 3)."""
        observed_names = self.producers.keys() | self.derived_inputs.keys()
        if not self.spec.skills:
            return tuple(name for name in self.variables if name in observed_names)
        names = [name for skill in self.spec.skills for name in skill.watched_variables]
        names += sorted((self.variables_read_by_loops | self.waking_variables) & observed_names)
        return tuple(name for name in dict.fromkeys(names) if name in self.variables)

    @cached_property
    def variables_read_by_loops(self) -> frozenset[str]:
        """The variables that rules and conditions of loops read, and those of all rates, which loops compute."""
        names = {name.name for site in self.sites if site.role in LOOP_ROLES for name in site.names}
        rates = (variable.rate for variable in self.spec.context)
        return frozenset(names | self.parsed_rules.read_names | {rate.of.name for rate in rates if rate is not None})

    @cached_property
    def waking_variables(self) -> frozenset[str]:
        """The variables in the `wakes` patterns of agents."""
        names = (name.name for site in self.sites if site.role is Role.WAKES for name in site.names)
        elements = (self.declared_graph.element_read_by(name) for name in names)
        return frozenset(element.name for element in elements if element is not None and element.section == "context")

    @cached_property
    def variables_in_force(self) -> frozenset[str]:
        """The variables in force when all decisions are declared. Read this only after all names are checked."""
        return frozenset(graph.closure(self.tree_variables, (*self.decisions, *sorted(self.suggested_variables))))

    @cached_property
    def mentioned_words(self) -> frozenset[str]:
        """Every name and quoted text that something refers to. A declaration of such a name is rarely misspelt."""
        mentioned_words = {source.name for variable in self.spec.context for source in variable.sources}
        for algorithm in self.spec.perception:
            mentioned_words.update(usage.resource.name for usage in algorithm.uses)
            mentioned_words.update(reference.name for reference in algorithm.given)
            mentioned_words.update(entry.variable.name for entry in algorithm.identifies)
            cases = (entry.by.cases for entry in algorithm.identifies if isinstance(entry.by, Members))
            mentioned_words.update(member.name for members in cases for member, _ in members)
        for skill in self.spec.skills:
            mentioned_words.update(skill.watched_variables)
            mentioned_words.update(reference.name for reference in skill.changes)
        for observer in self.spec.observers:
            mentioned_words.update(reference.name for reference in observer.identifies)
        for tree in (site.condition.tree for site in self.sites):
            parts = walk(tree) if tree is not None else ()
            mentioned_words.update(
                part.name if isinstance(part, Name) else part.value for part in parts if isinstance(part, Name | Text)
            )
        return frozenset(mentioned_words)

    @cached_property
    def judgements(self) -> Mapping[int, Judgement]:
        """A mapping from the `id` of each condition to its judgement."""
        sound_judgements: dict[tuple[object, ...], Judgement] = {}
        return {id(site.condition): self._judge(site, sound_judgements) for site in self.sites}

    def shape_over_results(self, algorithm: Algorithm, faults: FaultyElements) -> object:
        """Return a key that is the same for algorithms that use their results in the same way, except names and places.

        Trees and types are compared by identity: equal texts share one tree, and equal declarations share one type.
        """
        acceptance_tree_ids = tuple([id(condition.tree) for condition in algorithm.accept_when])
        identification_keys = tuple(
            [
                (
                    type(entry.by),
                    id(self.context_types.get(entry.variable.name)),
                    entry.variable.name in self.variables and faults.is_sound("context", entry.variable.name),
                    *[id(condition.tree) for condition in parts_of(entry)],
                )
                for entry in algorithm.identifies
            ]
        )
        optional_flags = tuple([returned.optional for returned in algorithm.returns])
        return id(self.returned_types[algorithm.name]), acceptance_tree_ids, identification_keys, optional_flags

    def python(self, condition: Condition, wanted: Type | None) -> str:
        """Return the Python text of a condition without errors. If `wanted` is numeric, the value is in its unit."""
        judgement = self.judgements[id(condition)]
        key = (id(judgement.typed), id(wanted))  # equal conditions share their typed tree
        if key not in self._python_texts:
            self._python_texts[key] = judgement.python(wanted)
        return self._python_texts[key]

    def judgement(self, condition: Condition) -> Judgement | None:
        """Return the judgement of a condition, or None if the condition could not be parsed."""
        return self.judgements.get(id(condition))

    def sound_tree(self, condition: Condition | None) -> Node | None:
        """Return the tree of a condition, with its names spelt out; None if there is none or it has a problem."""
        judgement = None if condition is None else self.judgement(condition)
        return None if judgement is None or judgement.problems else spelt_out(judgement.typed.node)

    def wanted_type(self, site: Site) -> Type | None:
        """Return the type of the context-variable that gets the value of a condition; a derived one gets no other."""
        variable = self.variables.get(site.variable or "")
        is_written = site.role in (*LOOP_ROLES, Role.IDENTIFIES)
        is_refused = is_written and variable is not None and variable.derived is not None
        return None if site.variable is None or is_refused else self.context_types.get(site.variable)

    @property
    def suggested_variables(self) -> frozenset[str]:
        """The context-variables suggested so far for unknown names."""
        return frozenset(name for (_, kind), name in self._near_names.items() if name is not None and kind == "context")

    def _group(self, names: Iterable[str]) -> Group:
        algorithms = (self.algorithms[name] for name in names)
        ranked_algorithms = tuple(sorted(algorithms, key=lambda algorithm: (algorithm.rank, algorithm.name)))
        identifications = (entry for algorithm in ranked_algorithms for entry in algorithm.identifies)
        return Group(ranked_algorithms, tuple(dict.fromkeys(entry.variable.name for entry in identifications)))

    def _judge(self, site: Site, sound_judgements: dict[tuple[object, ...], Judgement]) -> Judgement:
        """Return the judgement of a condition. `sound_judgements` is a cache for judgements without problems."""
        tree = site.condition.tree
        assert tree is not None
        wanted = self.wanted_type(site)
        readable_types: Types
        if site.role in KNOWLEDGE_ROLES:
            context_types, name_type = self.context_types, self.declared_graph.name_type
            readable_types = {name.name: context_types.get(name.name, name_type(name.name)) for name in site.names}
        elif site.role in CONTEXT_ROLES:
            readable_types = self.context_types
        elif site.role is Role.MONITOR and site.variable is not None:
            readable_types = {site.variable: wanted}
        else:
            readable_types = self.returned_types[site.owner[1]]
        types = (id(readable_types.get(name.name)) for name in site.names)
        key = (id(tree), site.role, site.result, id(wanted), *types)
        sound_judgement = sound_judgements.get(key)
        if sound_judgement is not None:
            return Judgement(site, sound_judgement.typed, ())
        judgement = judge(site, tree, readable_types, wanted)
        if not judgement.problems:
            sound_judgements[key] = judgement
        return judgement


def _by_name(elements: Iterable[Named]) -> Mapping[str, Named]:
    """Return a mapping from names to elements. If a name is declared twice, which `load` reports, use the first."""
    elements_by_name: dict[str, Named] = {}
    for element in elements:
        elements_by_name.setdefault(element.name, element)
    return elements_by_name
