"""Every condition of a spec: its place, the names that it may read, its type, and its Python text."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from enum import StrEnum

from codra_dsl.language.check.conditions.fitting import fit
from codra_dsl.language.check.conditions.lowering import to_python
from codra_dsl.language.check.conditions.types import Problem, Type, Typed, Types, infer, infer_condition
from codra_dsl.language.expression import (
    Call,
    Name,
    Node,
    Path,
    names_in,
    parse_derivation,
    walk,
)
from codra_dsl.language.expression.fallbacks import intended_fallbacks
from codra_dsl.language.expression.tokens import with_escapes
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model import (
    Adaptation,
    Agent,
    Algorithm,
    Condition,
    Hysteresis,
    Identification,
    Kind,
    Members,
    Parameter,
    Skill,
    Spec,
    Variable,
)


class Role(StrEnum):
    """The purpose of a condition, spelled as its key in the spec."""

    OBSERVABLE_WHEN = "observable_when"
    ACCEPT_WHEN = "accept_when"
    IDENTIFIES = "identifies"
    PREVIEW = "preview"
    MONITOR = "monitor"
    WAKES = "wakes"
    BEFORE = "before"
    DURING = "during"
    AFTER = "after"
    VALUE = "value"
    OTHERWISE = "otherwise"
    DERIVED = "derived"
    ALWAYS = "always"


KNOWLEDGE_ROLES = frozenset({Role.WAKES, Role.BEFORE, Role.DURING, Role.AFTER})
"""The roles of conditions in patterns. These conditions read context and all other knowledge."""

LOOP_ROLES = frozenset({Role.VALUE, Role.OTHERWISE, Role.ALWAYS})
"""The roles of conditions in adaptations."""

CONTEXT_ROLES = frozenset({Role.OBSERVABLE_WHEN, Role.PREVIEW, Role.DERIVED, *KNOWLEDGE_ROLES, *LOOP_ROLES})
"""The roles of conditions that read context."""


RESULT_ROLES = frozenset({Role.ACCEPT_WHEN, Role.IDENTIFIES})
"""The roles of conditions that read the values that an algorithm returns."""


class Result(StrEnum):
    """The kind of result of a condition: true or false, or the value of a context-variable."""

    TRUTH = "truth"
    VALUE = "value"


@dataclass(frozen=True, slots=True, kw_only=True)
class Site:
    """A condition and its position in the spec.

    Attributes:
        owner: the section and the name of the element that contains the condition.
        names: every mention of a name in the condition.
        values: the mentions that read the value of the name, i.e. all mentions outside of `known(x)` and `age(x)`.
        variable: the context-variable that gets the value of the condition, or that is expected to fulfil the
            condition.
        rule: the agent's rule that contains the condition; empty outside rules.
    """

    role: Role
    owner: tuple[str, str]
    condition: Condition
    names: tuple[Name, ...]
    values: tuple[Name, ...]
    variable: str | None = None
    result: Result = Result.TRUTH
    rule: str = ""

    @property
    def path(self) -> str:
        """Return the path of the key that contains the condition."""
        within = ("rules", self.rule) if self.rule else ()
        return ".".join((*self.owner, *within, self.role))


@dataclass(frozen=True, slots=True)
class Judgement:
    """The types in a condition, and the problems in it."""

    site: Site
    typed: Typed
    problems: tuple[Problem, ...]

    def python(self, wanted_type: Type | None) -> str:
        """Return the condition as Python text.

        `wanted_type` is the type of the variable that gets the value. A number is in the unit of this type.
        """
        return (
            to_python(self.typed, wanted_type.unit)
            if wanted_type is not None and wanted_type.is_number
            else to_python(self.typed)
        )


def sites(spec: Spec) -> Iterator[Site]:
    """Yield every condition of a spec that could be parsed, except patterns that are paths."""
    site_finder = _SiteFinder()
    sites_of_elements = (
        *map(site_finder.sites_of_variable, spec.context),
        *map(site_finder.sites_of_algorithm, spec.perception),
        *map(site_finder.sites_of_skill, spec.skills),
        *map(site_finder.sites_of_agent, spec.agents),
        *map(site_finder.sites_of_adaptation, spec.adaptation),
    )
    return (site for sites in sites_of_elements for site in sites if site is not None)


class _SiteFinder:
    """Finds the conditions of elements. Conditions with the same text share one tree, which is walked once."""

    def __init__(self) -> None:
        self._mentions: dict[int, tuple[tuple[Name, ...], tuple[Name, ...]]] = {}

    def sites_of_variable(self, variable: Variable) -> list[Site | None]:
        """Return the expression of a derived variable."""
        if variable.derived is None:
            return []
        return [self._site(Role.DERIVED, ("context", variable.name), variable.derived, variable.name, Result.VALUE)]

    def sites_of_algorithm(self, algorithm: Algorithm) -> list[Site | None]:
        """Return the conditions of an algorithm."""
        owner = ("perception", algorithm.name)
        algorithm_sites = [
            self._site(Role.OBSERVABLE_WHEN, owner, condition) for condition in algorithm.observable_when
        ]
        algorithm_sites += [self._site(Role.ACCEPT_WHEN, owner, condition) for condition in algorithm.accept_when]
        for entry in algorithm.identifies:
            result = Result.VALUE if isinstance(entry.by, Condition) else Result.TRUTH
            name = entry.variable.name
            algorithm_sites += [
                self._site(Role.IDENTIFIES, owner, condition, name, result) for condition in parts_of(entry)
            ]
        return algorithm_sites

    def sites_of_skill(self, skill: Skill) -> list[Site | None]:
        """Return the conditions of a skill."""
        owner = ("skills", skill.name)
        preview_sites = [self._site(Role.PREVIEW, owner, condition) for condition in skill.preview_conditions]
        return preview_sites + [
            self._site(Role.MONITOR, owner, expectation.condition, expectation.variable.name)
            for expectation in skill.monitor
            if expectation.condition is not None
        ]

    def sites_of_agent(self, agent: Agent) -> list[Site | None]:
        """Return the conditions among an agent's patterns."""
        owner, conduct = ("agents", agent.name), agent.conduct
        pattern_sites = [self._pattern(Role.WAKES, owner, pattern) for pattern in conduct.wakes]
        for rule in conduct.rules:
            for role, patterns in ((Role.BEFORE, rule.before), (Role.DURING, rule.during), (Role.AFTER, rule.after)):
                pattern_sites += [self._pattern(role, owner, pattern, rule.name) for pattern in patterns]
        return pattern_sites

    def sites_of_adaptation(self, adaptation: Adaptation) -> list[Site | None]:
        """Return the values of a parameter, or the conditions of the hard rules of a course."""
        owner, does = ("adaptation", adaptation.name), adaptation.does
        if isinstance(does, Parameter):
            values = ((Role.VALUE, does.value), (Role.OTHERWISE, does.otherwise))
            return [
                self._site(role, owner, value, does.variable.name, Result.VALUE)
                for role, value in values
                if value is not None
            ]
        return [self._site(Role.ALWAYS, owner, rule.condition) for rule in does.always]

    def _pattern(self, role: Role, owner: tuple[str, str], pattern: Condition, rule: str = "") -> Site | None:
        site = None if isinstance(pattern.tree, Path) else self._site(role, owner, pattern)
        return None if site is None else replace(site, rule=rule)

    def _site(
        self,
        role: Role,
        owner: tuple[str, str],
        condition: Condition,
        variable: str | None = None,
        result: Result = Result.TRUTH,
    ) -> Site | None:
        """Return a condition with its position, or None if the condition could not be parsed."""
        tree = condition.tree
        if tree is None:
            return None
        mentions = self._mentions.get(id(tree))
        if mentions is None:
            mentions = self._mentions[id(tree)] = _mentions(tree)
        names, values = mentions
        return Site(
            role=role, owner=owner, condition=condition, names=names, values=values, variable=variable, result=result
        )


def _mentions(tree: Node) -> tuple[tuple[Name, ...], tuple[Name, ...]]:
    """Return all mentions of names, and the mentions that read the value of the name."""
    if isinstance(tree, Name):  # most preconditions are a single name
        return (tree,), (tree,)
    parts = tuple(walk(tree))
    calls = (part for part in parts if isinstance(part, Call) and part.function in ("known", "age"))
    argument_ids = {id(call.arguments[0]) for call in calls}
    names = tuple(part for part in parts if isinstance(part, Name))
    return names, tuple(name for name in names if id(name) not in argument_ids) if argument_ids else names


def parts_of(entry: Identification) -> tuple[Condition, ...]:
    """Return the conditions that define the value of a variable."""
    if isinstance(entry.by, Members):
        return tuple(condition for _, condition in entry.by.cases)
    if isinstance(entry.by, Hysteresis):
        return (entry.by.enter,) if entry.by.leave is None else (entry.by.enter, entry.by.leave)
    return (entry.by,)


def judge(site: Site, tree: Node, readable_types: Types, wanted_type: Type | None) -> Judgement:
    """Return the types of a condition, and the problems in it.

    Args:
        site: the condition.
        tree: the syntax tree of the condition.
        readable_types: the types of the names that the condition can read.
        wanted_type: the type of the context-variable that gets the value of the condition, if there is one.
    """
    if isinstance(tree, Name) and site.result is Result.TRUTH:  # most preconditions are a single name
        declared = readable_types.get(tree.name)
        if declared is None or declared.kind is Kind.BOOL:
            return Judgement(site, Typed(tree, declared), ())
    reads_context = site.role in CONTEXT_ROLES
    if site.result is Result.TRUTH:
        return Judgement(site, *infer_condition(tree, readable_types, reads_context=reads_context))
    typed, problems = infer(tree, readable_types, reads_context=reads_context)
    if not problems and wanted_type is not None:
        problems = tuple(fit(typed, wanted_type, site.variable or "", may_map=site.role is Role.IDENTIFIES))
    intended_text = _with_parentheses(site, tree, readable_types) if problems and site.role is Role.DERIVED else None
    if intended_text is not None:
        problems = (replace(problems[0], help=f"write {with_escapes(intended_text)}"),)
    return Judgement(site, typed, problems)


def _with_parentheses(site: Site, tree: Node, readable_types: Types) -> str | None:
    """Return an expression with parentheses around `x else y`, if it then has no problem; otherwise None."""
    text = site.condition.text
    for start, end in intended_fallbacks(tree):
        has_name = any(start <= name.start < end for name in names_in(tree))
        if not has_name or (start, end) == (tree.start, tree.end):
            continue  # `2 m else 3 m` is never meant
        intended_text = f"{text[:start]}({text[start:end]}){text[end:]}"
        intended_tree = parse_derivation(intended_text)
        if isinstance(intended_tree, Node) and not infer(intended_tree, readable_types, reads_context=True)[1]:
            return intended_text
    return None
