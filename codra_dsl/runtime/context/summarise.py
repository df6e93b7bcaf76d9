"""The summary of a spec, built from the forest that runs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from codra_dsl.logic import Term
from codra_dsl.runtime.context.package_files import places_in
from codra_dsl.runtime.journal.spec_summary import AlgorithmSummary, ObserverSummary, Place, Rule, SpecSummary
from codra_dsl.runtime.observers.branch import Branch
from codra_dsl.runtime.observers.observer import Observer, ObserverModel
from codra_dsl.runtime.values.model import SkillModel, VariableModel

_KINDS_WITH_PLACE = frozenset({"context", "skill", "type", "node", "edge", "task"})


def summarise_spec(
    name: str,
    variables: Iterable[VariableModel],
    observers: Iterable[Observer],
    skills: Iterable[SkillModel],
    folder: Path | None,
) -> SpecSummary:
    """Return the summary of a spec whose forest is built.

    Args:
        name: the name of the spec.
        variables: the variables C_M.
        observers: the observers with their trees.
        skills: the skills of the main execution.
        folder: the folder of the generated package, with the places of all elements in the spec.
    """
    places, skills = places_in(folder, name), tuple(skills)
    models_and_branches = [(observer.model, branch) for observer in observers for branch in observer.branches]
    return SpecSummary(
        name=name,
        variables={variable.name: variable for variable in variables},
        observers={
            model.name: _observer_summary(
                model, [branch for branch_model, branch in models_and_branches if branch_model is model], places
            )
            for model, _ in models_and_branches
        },
        algorithms={branch.algorithm.name: _algorithm_summary(branch, places) for _, branch in models_and_branches},
        skills={skill.name: skill for skill in skills},
        previews={skill.name: _preview_rules(skill, places) for skill in skills if skill.preview_conditions},
        places={key: place for key, place in places.items() if key.split("/")[0] in _KINDS_WITH_PLACE},
    )


def _preview_rules(skill: SkillModel, places: Mapping[str, Place]) -> tuple[Rule, ...]:
    conditions = [(condition.text, condition.condition) for condition in skill.preview_conditions]
    return _rules_with_places(conditions, f"skill/{skill.name}/preview", places)


def _observer_summary(model: ObserverModel, branches: Sequence[Branch], places: Mapping[str, Place]) -> ObserverSummary:
    return ObserverSummary(
        name=model.name,
        identifies=model.identifies,
        algorithms=tuple(branch.algorithm.name for branch in branches),
        period_s=model.period_s,
        place=places.get(f"observer/{model.name}"),
    )


def _algorithm_summary(branch: Branch, places: Mapping[str, Place]) -> AlgorithmSummary:
    algorithm = branch.algorithm
    key = f"perception/{algorithm.name}"
    value_rules = {
        variable: Rule(python_text=repr(term), place=places.get(f"{key}/identifies/{variable}"))
        for variable, term in branch.value_terms.items()
    }
    return AlgorithmSummary(
        name=algorithm.name,
        preconditions=_condition_rules(branch, key, places),
        acceptance_conditions=_rules_with_places(branch.acceptance_conditions, f"{key}/accept_when", places),
        identifies=value_rules,
        returns=algorithm.returns,
        timeout_s=algorithm.timeout_s,
        host=algorithm.host,
        place=places.get(key),
    )


def _condition_rules(branch: Branch, key: str, places: Mapping[str, Place]) -> tuple[Rule, ...]:
    """Return the preconditions of a branch. The place of a precondition from `given` is that of the algorithm."""
    given_condition_texts = {f"known({name})" for name in branch.algorithm.given}
    own_conditions = [(text, term) for text, term in branch.conditions if text not in given_condition_texts]
    rules_by_text = {
        rule.source_text: rule for rule in _rules_with_places(own_conditions, f"{key}/observable_when", places)
    }
    return tuple(
        rules_by_text.get(text, Rule(source_text=text, python_text=repr(term), place=places.get(key)))
        for text, term in branch.conditions
    )


def _rules_with_places(
    conditions: Sequence[tuple[str, Term]], key: str, places: Mapping[str, Place]
) -> tuple[Rule, ...]:
    """Return conditions with their places. If there are more places than conditions, all places are left out."""
    condition_places = [places.get(f"{key}/{number}") for number in range(len(conditions))]
    if f"{key}/{len(conditions)}" in places:
        condition_places = [None] * len(conditions)
    return tuple(
        Rule(source_text=text, python_text=repr(term), place=place)
        for (text, term), place in zip(conditions, condition_places, strict=True)
    )
