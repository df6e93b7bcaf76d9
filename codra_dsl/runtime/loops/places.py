"""Places of the rules of loops in the spec.

Places are kept in a file beside the generated code, so that a new comment in the spec changes no code.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace

from codra_dsl.runtime.journal.spec_summary import Place
from codra_dsl.runtime.loops.declarations import CourseModel, MapeModel, StageModel, StageRuleModel

Places = Mapping[str, Place]


def with_places(model: MapeModel, places: Places) -> MapeModel:
    """Return the loops, with places added where they are missing.

    Args:
        model: the model of the loops.
        places: the places. Their keys are `metric/NAME/rules/NUMBER`, `action/NAME/rules/NUMBER`, `adaptation/NAME`
            and `adaptation/NAME/always/NUMBER`; numbers begin at 0.
    """
    return replace(
        model,
        metrics=_stage_with_places(model.metrics, "metric", places),
        actions=_stage_with_places(model.actions, "action", places),
        courses=tuple(_course_with_places(course, places) for course in model.courses),
        parameters=tuple(
            replace(parameter, place=parameter.place or _place_text(places, f"adaptation/{parameter.name}"))
            for parameter in model.parameters
        ),
    )


def _stage_with_places(model: StageModel | None, kind: str, places: Places) -> StageModel | None:
    if model is None:
        return None
    rule_counts: Counter[str] = Counter()
    rules: list[StageRuleModel] = []
    for rule in model.rules:
        name = rule.concludes[0]
        rules.append(replace(rule, place=rule.place or _place_text(places, f"{kind}/{name}/rules/{rule_counts[name]}")))
        rule_counts[name] += 1
    return replace(model, rules=tuple(rules))


def _course_with_places(model: CourseModel, places: Places) -> CourseModel:
    key = f"adaptation/{model.name}"
    always = tuple(
        replace(rule, place=rule.place or _place_text(places, f"{key}/always/{number}"))
        for number, rule in enumerate(model.always)
    )
    return replace(model, place=model.place or _place_text(places, key), always=always)


def _place_text(places: Places, key: str) -> str:
    return str(places[key]) if key in places else ""
