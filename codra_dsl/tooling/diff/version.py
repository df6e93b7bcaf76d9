"""Two versions of some specs, with look-ups for the comparers."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

from codra_dsl.generation.build_plan import BuildPlan, Tree
from codra_dsl.language.check.checked.spec import CheckedAlgorithm
from codra_dsl.language.check.index.graph_schema import DeclaredGraph
from codra_dsl.language.check.latency import worst_cases
from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model import Access, Spec, Variable


@dataclass(frozen=True, slots=True, kw_only=True)
class BrokenSpec:
    """A spec with errors. A plan for this spec can exist nevertheless.

    Attributes:
        name: the name of the spec; None if the spec could not be read.
        errors: the findings that prevent compilation.
    """

    name: str | None
    file: str
    errors: tuple[Diagnostic, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Version:
    """All specs of one version.

    Attributes:
        plans: the build plans of the specs that can be compared, even if they have errors.
        broken_specs: the specs with errors.
    """

    plans: tuple[BuildPlan, ...] = ()
    broken_specs: tuple[BrokenSpec, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Side:
    """One version of one spec."""

    plan: BuildPlan

    @property
    def spec(self) -> Spec:
        """Return the spec."""
        return self.plan.checked.spec

    @property
    def variables(self) -> Mapping[str, Variable]:
        """Return a mapping from names to all declared variables."""
        return self.plan.checked.variables

    @cached_property
    def declared_graph(self) -> DeclaredGraph:
        """Return the declared knowledge."""
        return DeclaredGraph(self.spec)

    @cached_property
    def algorithms(self) -> Mapping[str, CheckedAlgorithm]:
        """Return a mapping from names to the algorithms that observers run."""
        return {branch.name: branch.algorithm for tree in self.plan.forest for branch in tree.branches}

    @cached_property
    def observer_by_variable(self) -> Mapping[str, Tree]:
        """Return a mapping from each variable that an observer identifies to this observer."""
        return {variable: tree for tree in self.plan.forest for variable in tree.identifies}

    @cached_property
    def producers(self) -> Mapping[str, tuple[str, ...]]:
        """Return a mapping from each variable to the algorithms that identify it, in the order of their ranks.

        Algorithms that no observer runs are left out.
        """
        executed_producers = {
            variable: tuple(name for name in names if name in self.algorithms)
            for variable, names in self.plan.checked.producers.items()
        }
        return {variable: names for variable, names in executed_producers.items() if names}

    @cached_property
    def worst_latencies_s(self) -> Mapping[str, float]:
        """Return a mapping from each variable that observers identify to its longest time from declared to known."""
        latencies_s = worst_cases(self.plan.checked)
        return {name: latencies_s[name] for name in self.producers if name in latencies_s}

    def users(self, resource: str, access: Access) -> tuple[str, ...]:
        """Return the algorithms that use a resource with some access: that read its handle, or that need its slots."""
        return tuple(
            name
            for name, checked_algorithm in self.algorithms.items()
            if any(use.resource.name == resource and use.access is access for use in checked_algorithm.algorithm.uses)
        )


@dataclass(frozen=True, kw_only=True)
class Pair:
    """Both versions of a spec.

    Attributes:
        algorithms: the algorithms that are in both versions: a mapping from names in A to names in B.
    """

    old: Side
    new: Side
    algorithms: Mapping[str, str]

    @property
    def sides(self) -> tuple[Side, Side]:
        """Return A and B."""
        return self.old, self.new

    @property
    def added_variable_names(self) -> frozenset[str]:
        """Return the names of the variables that A does not have."""
        return frozenset(self.new.variables.keys() - self.old.variables.keys())

    @property
    def one_sided_variable_names(self) -> frozenset[str]:
        """Return the names of the variables that only one version has. They are reported only as removed or added."""
        return frozenset(self.new.variables.keys() ^ self.old.variables.keys())

    def element_id(self, kind: str, name: str) -> str:
        """Return the identifier of an element in changes."""
        return f"{self.new.spec.name}/{kind}/{name}"


def make_pair(old: BuildPlan, new: BuildPlan) -> Pair:
    """Return both versions of a spec as a pair.

    Algorithms are paired by name, or else by the function that they call and the variables that they identify.
    """
    sides = Side(plan=old), Side(plan=new)
    before, after = (side.algorithms for side in sides)
    new_name_by_old_name = {name: name for name in before if name in after}
    unpaired_identities = {
        name: _identity(checked_algorithm) for name, checked_algorithm in after.items() if name not in before
    }
    for name, checked_algorithm in before.items():
        matching_names = [
            other_name
            for other_name, identity in unpaired_identities.items()
            if identity == _identity(checked_algorithm)
        ]
        if name not in new_name_by_old_name and len(matching_names) == 1:
            new_name_by_old_name[name] = matching_names[0]
            del unpaired_identities[matching_names[0]]
    return Pair(old=sides[0], new=sides[1], algorithms=new_name_by_old_name)


def _identity(checked_algorithm: CheckedAlgorithm) -> tuple[str, frozenset[str]]:
    return checked_algorithm.algorithm.call, frozenset(variable for variable, _ in checked_algorithm.identifies)


def duration_text(duration_s: float | None) -> str:
    """Return a duration as specs write it; empty for None."""
    if duration_s is None:
        return ""
    return "forever" if duration_s == float("inf") else f"{duration_s:.10g} s"
