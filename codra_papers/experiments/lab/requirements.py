"""The declarations that a spec needs to run in the laboratory."""

from __future__ import annotations

from codra_dsl.language.model import Kind, Spec
from codra_papers.lab.mission import DECISION_VARIABLES, SKILLS
from codra_papers.lab.sequential_perception import VISION


def missing_declarations(spec: Spec) -> tuple[str, ...]:
    """Return, as texts, the declarations that the laboratory's main execution needs but a spec does not have."""
    declared_skills = {skill.name for skill in spec.skills}
    boolean_variables = {variable.name for variable in spec.context if variable.type.kind is Kind.BOOL}
    slot_resources = {resource.name for resource in spec.resources if resource.slots is not None}
    return (
        *(f"skill '{name}'" for name in SKILLS if name not in declared_skills),
        *(f"context-variable '{name}' of type bool" for name in DECISION_VARIABLES if name not in boolean_variables),
        *(f"resource '{name}' with slots" for name in (VISION,) if name not in slot_resources),
    )
