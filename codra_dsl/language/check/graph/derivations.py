"""Rules about derived variables: nobody writes them, and they follow from something."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.language.check.index.mentions import mention_of, user_of
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.diagnostics import Diagnostic, Related
from codra_dsl.language.expression import (
    And,
    Call,
    Choice,
    Fallback,
    Name,
    Node,
    Or,
    distances_in,
    names_in,
    parts,
)
from codra_dsl.language.model import Parameter, Reference, Variable


def can_be_known(part: Node | None, unknown_names: frozenset[str]) -> bool:
    """Return whether an expression can be known while some names are unknown. If this is undecided, return True."""
    match part:
        case Name(name=name):
            return name not in unknown_names
        case Call(function="known"):
            return True
        case And(operands=operands) | Or(operands=operands):
            return any(can_be_known(operand, unknown_names) for operand in operands)
        case Fallback(value=value, otherwise=otherwise):
            return can_be_known(value, unknown_names) or can_be_known(otherwise, unknown_names)
        case Choice(then=then, condition=condition, otherwise=otherwise):
            can_be = [can_be_known(operand, unknown_names) for operand in (then, condition, otherwise)]
            return sum(can_be) >= 2  # an unknown condition between equal values gives a known value
    return part is None or all(can_be_known(operand, unknown_names) for operand in parts(part))


def written_derived_variables(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """No algorithm identifies a derived variable, no skill changes it, and no adaptation sets it."""
    for reference, section, element, key in _written_references(spec_index):
        variable = spec_index.variables.get(reference.name)
        if variable is None or variable.derived is None:
            continue
        mention = mention_of(reference, section, element, key)
        yield finding(
            "written-derived-variable",
            f"{user_of(section, element)} writes '{variable.name}' with '{key}', but the variable is derived",
            reference.place,
            path=mention.path,
            help=f"remove it here, or remove 'derived' from '{variable.name}'",
            related=(Related("derived here", variable.derived.place),),
        )


def _written_references(spec_index: SpecIndex) -> Iterator[tuple[Reference, str, str, str]]:
    for algorithm in spec_index.spec.perception:
        for entry in algorithm.identifies:
            yield entry.variable, "perception", algorithm.name, "identifies"
    for skill in spec_index.spec.skills:
        for reference in skill.changes:
            yield reference, "skills", skill.name, "changes"
    for adaptation in spec_index.spec.adaptation:
        if isinstance(adaptation.does, Parameter):
            yield adaptation.does.variable, "adaptation", adaptation.name, "set"
    for agent in spec_index.spec.agents:
        for reference in agent.conduct.owns:
            yield reference, "agents", agent.name, "owns"


def constant_derivations(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """The expression of a derived variable reads context or the knowledge graph."""
    for variable in _derived_variables(spec_index):
        derived = variable.derived
        if derived is not None and derived.tree is not None and not names_in(derived.tree):
            yield finding(
                "constant-derivation",
                f"context-variable '{variable.name}' is derived from nothing: its value never changes",
                derived.place,
                path=f"context.{variable.name}.derived",
                help="read a context-variable, or write the value where the variable is used",
            )


def unrounded_distances(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """A derived variable that reads the number of a distance states a resolution, and no other variable does."""
    for variable in _derived_variables(spec_index):
        derived = variable.derived
        if (
            derived is None
            or derived.tree is None
            or not spec_index.is_readable("context", variable.name, "resolution")
        ):
            continue
        distance = next(distances_in(derived.tree), None)
        if distance is not None and variable.resolution_m is None:
            yield finding(
                "missing-resolution",
                f"context-variable '{variable.name}' is derived from {derived.text_of(distance)} without a resolution",
                derived.place_of(distance),
                path=f"context.{variable.name}.derived",
                help="add for example 'resolution: 10 cm': otherwise every pose changes the variable",
            )
        elif distance is None and variable.resolution_m is not None:
            yield finding(
                "ineffective-resolution",
                f"'resolution' of context-variable '{variable.name}' has no effect: nothing in 'derived' is rounded",
                variable.places.get("resolution", variable.place),
                path=f"context.{variable.name}.resolution",
                help="remove it: only distances that are used as numbers are rounded",
            )


DERIVATION_SOURCE_CHECKS = (written_derived_variables,)
"""The rules of phase 2."""

DERIVATION_TYPE_CHECKS = (constant_derivations, unrounded_distances)
"""The rules of phase 3."""


def _derived_variables(spec_index: SpecIndex) -> Iterator[Variable]:
    return (variable for variable in spec_index.spec.context if variable.derived is not None)
