"""Fuzzy engine actions: made from its declaration, not to be edited."""

from __future__ import annotations

import math

from codra_dsl.runtime.generated_api import (
    BoundedInference,
    Bounds,
    Inference,
    bounded_outputs,
    bounds,
    defuzzifiers,
    hedges,
    norms,
    outputs,
    terms,
)

INPUTS = (
    "mission_completion",
    "safety",
    "power_autonomy",
    "full_on_fork",
    "crowding",
    "loaded",
)
RANGES: tuple[Bounds, ...] = (
    Bounds(0.0, 1.0),
    Bounds(0.0, 1.0),
    Bounds(0.0, 1.0),
    Bounds(0.0, 1.0),
    Bounds(0.0, 1.0),
    Bounds(0.0, 1.0),
)
OUTPUTS = (
    "weight_of_pick",
    "weight_of_deliver",
    "weight_of_start",
    "weight_of_dock",
)
RULES = (
    "if mission_completion is not high and safety is high and power_autonomy is not low and full_on_fork is false then weight_of_pick is high",
    "if mission_completion is not high and safety is medium and crowding is not persistent and power_autonomy is not low and full_on_fork is false then weight_of_pick is high",
    "if mission_completion is high or safety is low or power_autonomy is low or full_on_fork is true then weight_of_pick is low",
    "if safety is medium and crowding is persistent then weight_of_pick is low",
    "if full_on_fork is true and safety is not low and power_autonomy is not low then weight_of_deliver is high",
    "if loaded is true and mission_completion is high and safety is not low and power_autonomy is not low then weight_of_deliver is high",
    "if loaded is false or safety is low or power_autonomy is low then weight_of_deliver is low",
    "if full_on_fork is false and mission_completion is not high then weight_of_deliver is low",
    "if safety is low and loaded is false then weight_of_start is high",
    "if safety is medium and crowding is persistent and loaded is false then weight_of_start is high",
    "if safety is medium and crowding is not persistent and mission_completion is not high and loaded is false then weight_of_start is low",
    "if safety is low and loaded is true then weight_of_start is medium",
    "if mission_completion is high and loaded is false then weight_of_start is medium",
    "if safety is high and mission_completion is not high then weight_of_start is low",
    "if safety is not low and loaded is true then weight_of_start is low",
    "if power_autonomy is low then weight_of_dock is high",
    "if power_autonomy is not low then weight_of_dock is low",
)

WEIGHT_OF_PICK = outputs.Integral(
    minimum=0.0,
    maximum=1.0,
    resolution=1000,
    defuzzify=defuzzifiers.centroid,
    aggregation=norms.maximum,
    memberships=(
        lambda x: terms.ramp(x, 0.5, 0.2),
        lambda x: terms.ramp(x, 0.5, 0.8),
    ),
    conclusions=(
        outputs.Conclusion(term=1, implication=norms.minimum),
        outputs.Conclusion(term=1, implication=norms.minimum),
        outputs.Conclusion(term=0, implication=norms.minimum),
        outputs.Conclusion(term=0, implication=norms.minimum),
    ),
)
WEIGHT_OF_DELIVER = outputs.Integral(
    minimum=0.0,
    maximum=1.0,
    resolution=1000,
    defuzzify=defuzzifiers.centroid,
    aggregation=norms.maximum,
    memberships=(
        lambda x: terms.ramp(x, 0.5, 0.2),
        lambda x: terms.ramp(x, 0.5, 0.8),
    ),
    conclusions=(
        outputs.Conclusion(term=1, implication=norms.minimum),
        outputs.Conclusion(term=1, implication=norms.minimum),
        outputs.Conclusion(term=0, implication=norms.minimum),
        outputs.Conclusion(term=0, implication=norms.minimum),
    ),
)
WEIGHT_OF_START = outputs.Integral(
    minimum=0.0,
    maximum=1.0,
    resolution=1000,
    defuzzify=defuzzifiers.centroid,
    aggregation=norms.maximum,
    memberships=(
        lambda x: terms.ramp(x, 0.5, 0.2),
        lambda x: terms.triangle(x, 0.2, 0.5, 0.8),
        lambda x: terms.ramp(x, 0.5, 0.8),
    ),
    conclusions=(
        outputs.Conclusion(term=2, implication=norms.minimum),
        outputs.Conclusion(term=2, implication=norms.minimum),
        outputs.Conclusion(term=0, implication=norms.minimum),
        outputs.Conclusion(term=1, implication=norms.minimum),
        outputs.Conclusion(term=1, implication=norms.minimum),
        outputs.Conclusion(term=0, implication=norms.minimum),
        outputs.Conclusion(term=0, implication=norms.minimum),
    ),
)
WEIGHT_OF_DOCK = outputs.Integral(
    minimum=0.0,
    maximum=1.0,
    resolution=1000,
    defuzzify=defuzzifiers.centroid,
    aggregation=norms.maximum,
    memberships=(
        lambda x: terms.ramp(x, 0.5, 0.2),
        lambda x: terms.ramp(x, 0.5, 0.8),
    ),
    conclusions=(
        outputs.Conclusion(term=1, implication=norms.minimum),
        outputs.Conclusion(term=0, implication=norms.minimum),
    ),
)


def infer(
    mission_completion: float,
    safety: float,
    power_autonomy: float,
    full_on_fork: float,
    crowding: float,
    loaded: float,
    *,
    previous: tuple[float, ...] = (math.nan,) * 4,
) -> Inference:
    """Return the outputs and the strengths of the rules; `previous` has the previous outputs."""
    mission_completion_high = terms.ramp(mission_completion, 0.5, 0.8)
    safety_low = terms.ramp(safety, 0.5, 0.2)
    safety_medium = terms.triangle(safety, 0.2, 0.5, 0.8)
    safety_high = terms.ramp(safety, 0.5, 0.8)
    power_autonomy_low = terms.ramp(power_autonomy, 0.5, 0.2)
    full_on_fork_false = terms.rectangle(full_on_fork, -0.5, 0.5)
    full_on_fork_true = terms.rectangle(full_on_fork, 0.5, 1.5)
    crowding_persistent = terms.ramp(crowding, 0.5, 0.7)
    loaded_false = terms.rectangle(loaded, -0.5, 0.5)
    loaded_true = terms.rectangle(loaded, 0.5, 1.5)
    rule_1 = norms.minimum(norms.minimum(norms.minimum(hedges.not_(mission_completion_high), safety_high), hedges.not_(power_autonomy_low)), full_on_fork_false)
    rule_2 = norms.minimum(norms.minimum(norms.minimum(norms.minimum(hedges.not_(mission_completion_high), safety_medium), hedges.not_(crowding_persistent)), hedges.not_(power_autonomy_low)), full_on_fork_false)
    rule_3 = norms.maximum(norms.maximum(norms.maximum(mission_completion_high, safety_low), power_autonomy_low), full_on_fork_true)
    rule_4 = norms.minimum(safety_medium, crowding_persistent)
    rule_5 = norms.minimum(norms.minimum(full_on_fork_true, hedges.not_(safety_low)), hedges.not_(power_autonomy_low))
    rule_6 = norms.minimum(norms.minimum(norms.minimum(loaded_true, mission_completion_high), hedges.not_(safety_low)), hedges.not_(power_autonomy_low))
    rule_7 = norms.maximum(norms.maximum(loaded_false, safety_low), power_autonomy_low)
    rule_8 = norms.minimum(full_on_fork_false, hedges.not_(mission_completion_high))
    rule_9 = norms.minimum(safety_low, loaded_false)
    rule_10 = norms.minimum(norms.minimum(safety_medium, crowding_persistent), loaded_false)
    rule_11 = norms.minimum(norms.minimum(norms.minimum(safety_medium, hedges.not_(crowding_persistent)), hedges.not_(mission_completion_high)), loaded_false)
    rule_12 = norms.minimum(safety_low, loaded_true)
    rule_13 = norms.minimum(mission_completion_high, loaded_false)
    rule_14 = norms.minimum(safety_high, hedges.not_(mission_completion_high))
    rule_15 = norms.minimum(hedges.not_(safety_low), loaded_true)
    rule_16 = power_autonomy_low
    rule_17 = hedges.not_(power_autonomy_low)
    weight_of_pick = WEIGHT_OF_PICK.value((rule_1, rule_2, rule_3, rule_4))
    weight_of_pick = outputs.clipped(weight_of_pick, 0.0, 1.0)
    weight_of_deliver = WEIGHT_OF_DELIVER.value((rule_5, rule_6, rule_7, rule_8))
    weight_of_deliver = outputs.clipped(weight_of_deliver, 0.0, 1.0)
    weight_of_start = WEIGHT_OF_START.value((rule_9, rule_10, rule_11, rule_12, rule_13, rule_14, rule_15))
    weight_of_start = outputs.clipped(weight_of_start, 0.0, 1.0)
    weight_of_dock = WEIGHT_OF_DOCK.value((rule_16, rule_17))
    weight_of_dock = outputs.clipped(weight_of_dock, 0.0, 1.0)
    return Inference((weight_of_pick, weight_of_deliver, weight_of_start, weight_of_dock), (rule_1, rule_2, rule_3, rule_4, rule_5, rule_6, rule_7, rule_8, rule_9, rule_10, rule_11, rule_12, rule_13, rule_14, rule_15, rule_16, rule_17))


def infer_bounds(
    mission_completion: Bounds,
    safety: Bounds,
    power_autonomy: Bounds,
    full_on_fork: Bounds,
    crowding: Bounds,
    loaded: Bounds,
    *,
    previous: tuple[Bounds, ...] = (bounds.UNKNOWN,) * 4,
) -> BoundedInference:
    """Return the outputs and the strengths of the rules; `previous` has the previous outputs."""
    mission_completion_high = bounds.image(terms.ramp, mission_completion, 0.5, 0.8)
    safety_low = bounds.image(terms.ramp, safety, 0.5, 0.2)
    safety_medium = bounds.image(terms.triangle, safety, 0.2, 0.5, 0.8)
    safety_high = bounds.image(terms.ramp, safety, 0.5, 0.8)
    power_autonomy_low = bounds.image(terms.ramp, power_autonomy, 0.5, 0.2)
    full_on_fork_false = bounds.image(terms.rectangle, full_on_fork, -0.5, 0.5)
    full_on_fork_true = bounds.image(terms.rectangle, full_on_fork, 0.5, 1.5)
    crowding_persistent = bounds.image(terms.ramp, crowding, 0.5, 0.7)
    loaded_false = bounds.image(terms.rectangle, loaded, -0.5, 0.5)
    loaded_true = bounds.image(terms.rectangle, loaded, 0.5, 1.5)
    rule_1 = bounds.norm(norms.minimum, bounds.norm(norms.minimum, bounds.norm(norms.minimum, bounds.hedge(hedges.not_, mission_completion_high), safety_high), bounds.hedge(hedges.not_, power_autonomy_low)), full_on_fork_false)
    rule_2 = bounds.norm(norms.minimum, bounds.norm(norms.minimum, bounds.norm(norms.minimum, bounds.norm(norms.minimum, bounds.hedge(hedges.not_, mission_completion_high), safety_medium), bounds.hedge(hedges.not_, crowding_persistent)), bounds.hedge(hedges.not_, power_autonomy_low)), full_on_fork_false)
    rule_3 = bounds.norm(norms.maximum, bounds.norm(norms.maximum, bounds.norm(norms.maximum, mission_completion_high, safety_low), power_autonomy_low), full_on_fork_true)
    rule_4 = bounds.norm(norms.minimum, safety_medium, crowding_persistent)
    rule_5 = bounds.norm(norms.minimum, bounds.norm(norms.minimum, full_on_fork_true, bounds.hedge(hedges.not_, safety_low)), bounds.hedge(hedges.not_, power_autonomy_low))
    rule_6 = bounds.norm(norms.minimum, bounds.norm(norms.minimum, bounds.norm(norms.minimum, loaded_true, mission_completion_high), bounds.hedge(hedges.not_, safety_low)), bounds.hedge(hedges.not_, power_autonomy_low))
    rule_7 = bounds.norm(norms.maximum, bounds.norm(norms.maximum, loaded_false, safety_low), power_autonomy_low)
    rule_8 = bounds.norm(norms.minimum, full_on_fork_false, bounds.hedge(hedges.not_, mission_completion_high))
    rule_9 = bounds.norm(norms.minimum, safety_low, loaded_false)
    rule_10 = bounds.norm(norms.minimum, bounds.norm(norms.minimum, safety_medium, crowding_persistent), loaded_false)
    rule_11 = bounds.norm(norms.minimum, bounds.norm(norms.minimum, bounds.norm(norms.minimum, safety_medium, bounds.hedge(hedges.not_, crowding_persistent)), bounds.hedge(hedges.not_, mission_completion_high)), loaded_false)
    rule_12 = bounds.norm(norms.minimum, safety_low, loaded_true)
    rule_13 = bounds.norm(norms.minimum, mission_completion_high, loaded_false)
    rule_14 = bounds.norm(norms.minimum, safety_high, bounds.hedge(hedges.not_, mission_completion_high))
    rule_15 = bounds.norm(norms.minimum, bounds.hedge(hedges.not_, safety_low), loaded_true)
    rule_16 = power_autonomy_low
    rule_17 = bounds.hedge(hedges.not_, power_autonomy_low)
    weight_of_pick = bounded_outputs.integral(WEIGHT_OF_PICK, (rule_1, rule_2, rule_3, rule_4))
    weight_of_pick = bounds.clipped(weight_of_pick, 0.0, 1.0)
    weight_of_deliver = bounded_outputs.integral(WEIGHT_OF_DELIVER, (rule_5, rule_6, rule_7, rule_8))
    weight_of_deliver = bounds.clipped(weight_of_deliver, 0.0, 1.0)
    weight_of_start = bounded_outputs.integral(WEIGHT_OF_START, (rule_9, rule_10, rule_11, rule_12, rule_13, rule_14, rule_15))
    weight_of_start = bounds.clipped(weight_of_start, 0.0, 1.0)
    weight_of_dock = bounded_outputs.integral(WEIGHT_OF_DOCK, (rule_16, rule_17))
    weight_of_dock = bounds.clipped(weight_of_dock, 0.0, 1.0)
    return BoundedInference((weight_of_pick, weight_of_deliver, weight_of_start, weight_of_dock), (rule_1, rule_2, rule_3, rule_4, rule_5, rule_6, rule_7, rule_8, rule_9, rule_10, rule_11, rule_12, rule_13, rule_14, rule_15, rule_16, rule_17))
