"""Rules about derived variables: they have no writer and at least one input."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.language.check.index.mentions import mention_of, user_of, variable_references
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.diagnostics import Diagnostic, Related
from codra_dsl.language.expression import Node, distances_in, names_in
from codra_dsl.language.model import Condition, Variable

_WRITING_KEYS = {("perception", "identifies"), ("skills", "changes"), ("adaptation", "set"), ("agents", "owns")}
"""The sections and keys whose names are those of variables that an element writes."""


def written_derived_variables(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """No algorithm identifies a derived variable, no skill changes it, and no adaptation sets it."""
    agents = spec_index.spec.agents
    owned = [(reference, "agents", agent.name, "owns") for agent in agents for reference in agent.conduct.owns]
    for reference, section, element, key in (*variable_references(spec_index), *owned):
        variable = spec_index.variables.get(reference.name)
        if (section, key) not in _WRITING_KEYS or variable is None or variable.derived is None:
            continue
        yield finding(
            "written-derived-variable",
            f"{user_of(section, element)} writes '{variable.name}' with '{key}', but the variable is derived",
            reference.place,
            path=mention_of(reference, section, element, key).path,
            help=f"remove it here, or remove 'derived' from '{variable.name}'",
            related=(Related("derived here", variable.derived.place),),
        )


def constant_derivations(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """The expression of a derived variable reads context or the knowledge graph."""
    for variable, derived, tree in _derivations(spec_index):
        if not names_in(tree):
            yield finding(
                "constant-derivation",
                f"context-variable '{variable.name}' is derived from nothing: its value never changes",
                derived.place,
                path=f"context.{variable.name}.derived",
                help="read a context-variable, or write the value where the variable is used",
            )


def unrounded_distances(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """A derived variable that reads the number of a distance states a resolution, and no other variable does."""
    for variable, derived, tree in _derivations(spec_index):
        distance = next(distances_in(tree), None)
        if (distance is None) is (variable.resolution_m is None):
            continue
        if not spec_index.is_readable("context", variable.name, "resolution"):
            continue
        if distance is not None:
            yield finding(
                "missing-resolution",
                f"context-variable '{variable.name}' is derived from {derived.text_of(distance)} without a resolution",
                derived.place_of(distance),
                path=f"context.{variable.name}.derived",
                help="add for example 'resolution: 10 cm': otherwise every pose changes the variable",
            )
        else:
            yield finding(
                "ineffective-resolution",
                f"'resolution' of context-variable '{variable.name}' has no effect: nothing in 'derived' is rounded",
                variable.places.get("resolution", variable.place),
                path=f"context.{variable.name}.resolution",
                help="remove it: only distances that are used as numbers are rounded",
            )


def _derivations(spec_index: SpecIndex) -> Iterator[tuple[Variable, Condition, Node]]:
    """Yield each derived variable with its expression and the tree of this expression."""
    for variable in spec_index.spec.context:
        if variable.derived is not None and variable.derived.tree is not None:
            yield variable, variable.derived, variable.derived.tree


DERIVATION_SOURCE_CHECKS = (written_derived_variables,)
"""The rules of phase 2."""

DERIVATION_TYPE_CHECKS = (constant_derivations, unrounded_distances)
"""The rules of phase 3."""
