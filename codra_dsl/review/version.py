"""One version of some specs, as reviews look at it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from codra_dsl.build_plan import BuildPlan, Tree
from codra_dsl.check.checked import CheckedAlgorithm
from codra_dsl.check.latency import worst_cases
from codra_dsl.diagnostics import Diagnostic, Place
from codra_dsl.model import Access, Resource, Skill, Variable


@dataclass(frozen=True, slots=True, kw_only=True)
class Broken:
    """A spec with errors, be it planned all the same.

    Attributes:
        name: None where it could not be read.
        errors: the findings for which it is not compiled.
    """

    name: str | None
    file: str
    errors: tuple[Diagnostic, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Version:
    """All specs of one version.

    Attributes:
        plans: of the specs whose errors, if any, leave something that can be compared.
        broken: the specs with errors.
    """

    plans: tuple[BuildPlan, ...] = ()
    broken: tuple[Broken, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Side:
    """One version of one spec, with what reviews ask of it."""

    plan: BuildPlan

    @property
    def name(self) -> str:
        """Return the spec's name."""
        return self.plan.name

    @cached_property
    def variables(self) -> Mapping[str, Variable]:
        """Return all declared variables by name."""
        return self.plan.checked.variables

    @cached_property
    def algorithms(self) -> Mapping[str, CheckedAlgorithm]:
        """Return the algorithms that observers run, by name."""
        return {branch.name: branch.algorithm for tree in self.plan.forest for branch in tree.branches}

    @cached_property
    def observer_of(self) -> Mapping[str, Tree]:
        """Return the observer of each variable that has one."""
        return {variable: tree for tree in self.plan.forest for variable in tree.identifies}

    @cached_property
    def producers(self) -> Mapping[str, tuple[str, ...]]:
        """Return for each variable the algorithms that identify it and that observers run, by rank."""
        found = {
            variable: tuple(name for name in names if name in self.algorithms)
            for variable, names in self.plan.checked.producers.items()
        }
        return {variable: names for variable, names in found.items() if names}

    @cached_property
    def skills(self) -> Mapping[str, Skill]:
        """Return the skills by name."""
        return {skill.name: skill for skill in self.plan.checked.spec.skills}

    @cached_property
    def resources(self) -> Mapping[str, Resource]:
        """Return the resources by name."""
        return {resource.name: resource for resource in self.plan.checked.spec.resources}

    @cached_property
    def settings(self) -> Mapping[str, Mapping[str, Place]]:
        """Return the places of what `observers` says of each tree that it names."""
        return {setting.name: setting.places for setting in self.plan.checked.spec.observers}

    @cached_property
    def worst_s(self) -> Mapping[str, float]:
        """Return for each variable that observers identify the worst time from declared to known."""
        found = worst_cases(self.plan.checked)
        return {name: found[name] for name in self.producers if name in found}

    def users(self, resource: str, access: Access) -> tuple[str, ...]:
        """Return the algorithms that read a resource or take its slots."""
        return tuple(
            name
            for name, each in self.algorithms.items()
            if any(use.resource.name == resource and use.access is access for use in each.algorithm.uses)
        )

    def id(self, kind: str, name: str) -> str:
        """Return how changes call an element."""
        return f"{self.name}/{kind}/{name}"


@dataclass(frozen=True, kw_only=True)
class Pair:
    """Both versions of a spec.

    Attributes:
        algorithms: names in B by names in A, of the algorithms that are in both.
    """

    old: Side
    new: Side
    algorithms: Mapping[str, str]

    @property
    def lost(self) -> frozenset[str]:
        """Return the variables that B has no more."""
        return frozenset(self.old.variables) - frozenset(self.new.variables)

    @property
    def gained(self) -> frozenset[str]:
        """Return the variables that A did not have."""
        return frozenset(self.new.variables) - frozenset(self.old.variables)

    @property
    def one_sided(self) -> frozenset[str]:
        """Return the variables of which only their coming or going is told."""
        return self.lost | self.gained


def paired(old: BuildPlan, new: BuildPlan) -> Pair:
    """Return both versions of a spec, algorithms paired by name, else by what they call and identify."""
    sides = Side(plan=old), Side(plan=new)
    before, after = (side.algorithms for side in sides)
    pairs = {name: name for name in before if name in after}
    open_ = {name: _meaning(each) for name, each in after.items() if name not in before}
    for name, each in before.items():
        same = [other for other, meaning in open_.items() if meaning == _meaning(each)]
        if name not in pairs and len(same) == 1:
            pairs[name] = same[0]
            del open_[same[0]]
    return Pair(old=sides[0], new=sides[1], algorithms=pairs)


def _meaning(algorithm: CheckedAlgorithm) -> tuple[str, frozenset[str]]:
    return algorithm.algorithm.call, frozenset(variable for variable, _ in algorithm.identifies)


def seconds(duration_s: float) -> str:
    """Return a duration as specs write it."""
    return "forever" if duration_s == float("inf") else f"{duration_s:.10g} s"
