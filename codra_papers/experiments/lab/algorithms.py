"""Questions about the perception algorithms of a spec."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from codra_dsl.language.expression import Name
from codra_dsl.language.model import Access, Spec
from codra_papers.experiments.lab.spec_variants import WithoutAlternatives


def vision_algorithms(spec: Spec) -> tuple[str, ...]:
    """Return the names of the algorithms that need a slot; these are all algorithms that look at frames."""
    return tuple(
        algorithm.name for algorithm in spec.perception if any(use.access is Access.SLOT for use in algorithm.uses)
    )


def alternatives(spec: Spec) -> Mapping[str, Sequence[str]]:
    """Return the alternatives of each variable: all its algorithms except for the one with the lowest rank."""
    first_names = {algorithm.name for algorithm in WithoutAlternatives()(spec).perception}
    names_by_variable: dict[str, list[str]] = {}
    for algorithm in spec.perception:
        if algorithm.name not in first_names:
            for entry in algorithm.identifies:
                names_by_variable.setdefault(entry.variable.name, []).append(algorithm.name)
    return names_by_variable


def plain_preconditions(spec: Spec) -> Mapping[str, Sequence[str]]:
    """Return the variables in the preconditions of each algorithm whose preconditions are all names of variables."""
    trees_by_algorithm = {
        algorithm.name: [condition.tree for condition in algorithm.observable_when] for algorithm in spec.perception
    }
    return {
        algorithm: [tree.name for tree in trees if isinstance(tree, Name)]
        for algorithm, trees in trees_by_algorithm.items()
        if trees and all(isinstance(tree, Name) for tree in trees)
    }
