"""Fuzzy engine metrics: made from its declaration, not to be edited."""

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
    "bumped",
    "picking_up",
    "people_at_container",
    "container_load",
    "person_distance",
    "order_open",
    "loaded",
    "battery_level",
    "charging",
    "battery_drain",
)
RANGES: tuple[Bounds, ...] = (
    Bounds(0.0, 1.0),
    Bounds(0.0, 1.0),
    Bounds(0.0, 20.0),
    Bounds(0.0, 2.0),
    Bounds(0.0, 10.0),
    Bounds(0.0, 1.0),
    Bounds(0.0, 1.0),
    Bounds(0.0, 100.0),
    Bounds(0.0, 1.0),
    Bounds(0.0, 20.0),
)
OUTPUTS = (
    "safety",
    "mission_completion",
    "power_autonomy",
)
RULES = (
    "if bumped is true then safety is low",
    "if picking_up is true and people_at_container is several then safety is low",
    "if picking_up is true and people_at_container is one and container_load is not empty then safety is low with 0.5",
    "if bumped is false and picking_up is true and people_at_container is one then safety is medium",
    "if bumped is false and picking_up is true and people_at_container is nobody and person_distance is close then safety is medium",
    "if bumped is false and picking_up is true and people_at_container is nobody and person_distance is not close then safety is high",
    "if bumped is false and picking_up is false then safety is high",
    "if order_open is false then mission_completion is high",
    "if order_open is true and loaded is true then mission_completion is medium",
    "if order_open is true and loaded is false then mission_completion is low",
    "if battery_level is empty then power_autonomy is low",
    "if charging is true and battery_level is not charged then power_autonomy is low",
    "if charging is false and battery_drain is fast and battery_level is scarce then power_autonomy is low",
    "if battery_level is full and charging is false and battery_drain is fast and battery_level is not scarce then power_autonomy is medium",
    "if battery_level is full and charging is false and battery_drain is not fast then power_autonomy is high",
    "if charging is true and battery_level is charged then power_autonomy is high",
)

SAFETY = outputs.Integral(
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
        outputs.Conclusion(term=0, implication=norms.minimum),
        outputs.Conclusion(term=0, implication=norms.minimum),
        outputs.Conclusion(term=0, implication=norms.minimum),
        outputs.Conclusion(term=1, implication=norms.minimum),
        outputs.Conclusion(term=1, implication=norms.minimum),
        outputs.Conclusion(term=2, implication=norms.minimum),
        outputs.Conclusion(term=2, implication=norms.minimum),
    ),
)
MISSION_COMPLETION = outputs.Integral(
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
        outputs.Conclusion(term=1, implication=norms.minimum),
        outputs.Conclusion(term=0, implication=norms.minimum),
    ),
)
POWER_AUTONOMY = outputs.Integral(
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
        outputs.Conclusion(term=0, implication=norms.minimum),
        outputs.Conclusion(term=0, implication=norms.minimum),
        outputs.Conclusion(term=0, implication=norms.minimum),
        outputs.Conclusion(term=1, implication=norms.minimum),
        outputs.Conclusion(term=2, implication=norms.minimum),
        outputs.Conclusion(term=2, implication=norms.minimum),
    ),
)


def infer(
    bumped: float,
    picking_up: float,
    people_at_container: float,
    container_load: float,
    person_distance: float,
    order_open: float,
    loaded: float,
    battery_level: float,
    charging: float,
    battery_drain: float,
    *,
    previous: tuple[float, ...] = (math.nan,) * 3,
) -> Inference:
    """Return the outputs and the strengths of the rules; `previous` has the previous outputs."""
    bumped_false = terms.rectangle(bumped, -0.5, 0.5)
    bumped_true = terms.rectangle(bumped, 0.5, 1.5)
    picking_up_false = terms.rectangle(picking_up, -0.5, 0.5)
    picking_up_true = terms.rectangle(picking_up, 0.5, 1.5)
    people_at_container_nobody = terms.ramp(people_at_container, 1.0, 0.0)
    people_at_container_one = terms.triangle(people_at_container, 0.0, 1.0, 2.0)
    people_at_container_several = terms.ramp(people_at_container, 1.0, 2.0)
    container_load_empty = terms.rectangle(container_load, -0.5, 0.5)
    person_distance_close = terms.ramp(person_distance, 2.5, 1.5)
    order_open_false = terms.rectangle(order_open, -0.5, 0.5)
    order_open_true = terms.rectangle(order_open, 0.5, 1.5)
    loaded_false = terms.rectangle(loaded, -0.5, 0.5)
    loaded_true = terms.rectangle(loaded, 0.5, 1.5)
    battery_level_empty = terms.ramp(battery_level, 30.0, 10.0)
    battery_level_full = terms.ramp(battery_level, 10.0, 30.0)
    battery_level_scarce = terms.ramp(battery_level, 45.0, 30.0)
    battery_level_charged = terms.ramp(battery_level, 70.0, 95.0)
    charging_false = terms.rectangle(charging, -0.5, 0.5)
    charging_true = terms.rectangle(charging, 0.5, 1.5)
    battery_drain_fast = terms.ramp(battery_drain, 5.0, 7.0)
    rule_1 = bumped_true
    rule_2 = norms.minimum(picking_up_true, people_at_container_several)
    rule_3 = 0.5 * norms.minimum(norms.minimum(picking_up_true, people_at_container_one), hedges.not_(container_load_empty))
    rule_4 = norms.minimum(norms.minimum(bumped_false, picking_up_true), people_at_container_one)
    rule_5 = norms.minimum(norms.minimum(norms.minimum(bumped_false, picking_up_true), people_at_container_nobody), person_distance_close)
    rule_6 = norms.minimum(norms.minimum(norms.minimum(bumped_false, picking_up_true), people_at_container_nobody), hedges.not_(person_distance_close))
    rule_7 = norms.minimum(bumped_false, picking_up_false)
    rule_8 = order_open_false
    rule_9 = norms.minimum(order_open_true, loaded_true)
    rule_10 = norms.minimum(order_open_true, loaded_false)
    rule_11 = battery_level_empty
    rule_12 = norms.minimum(charging_true, hedges.not_(battery_level_charged))
    rule_13 = norms.minimum(norms.minimum(charging_false, battery_drain_fast), battery_level_scarce)
    rule_14 = norms.minimum(norms.minimum(norms.minimum(battery_level_full, charging_false), battery_drain_fast), hedges.not_(battery_level_scarce))
    rule_15 = norms.minimum(norms.minimum(battery_level_full, charging_false), hedges.not_(battery_drain_fast))
    rule_16 = norms.minimum(charging_true, battery_level_charged)
    safety = SAFETY.value((rule_1, rule_2, rule_3, rule_4, rule_5, rule_6, rule_7))
    safety = outputs.clipped(safety, 0.0, 1.0)
    mission_completion = MISSION_COMPLETION.value((rule_8, rule_9, rule_10))
    mission_completion = outputs.clipped(mission_completion, 0.0, 1.0)
    power_autonomy = POWER_AUTONOMY.value((rule_11, rule_12, rule_13, rule_14, rule_15, rule_16))
    power_autonomy = outputs.clipped(power_autonomy, 0.0, 1.0)
    return Inference((safety, mission_completion, power_autonomy), (rule_1, rule_2, rule_3, rule_4, rule_5, rule_6, rule_7, rule_8, rule_9, rule_10, rule_11, rule_12, rule_13, rule_14, rule_15, rule_16))


def infer_bounds(
    bumped: Bounds,
    picking_up: Bounds,
    people_at_container: Bounds,
    container_load: Bounds,
    person_distance: Bounds,
    order_open: Bounds,
    loaded: Bounds,
    battery_level: Bounds,
    charging: Bounds,
    battery_drain: Bounds,
    *,
    previous: tuple[Bounds, ...] = (bounds.UNKNOWN,) * 3,
) -> BoundedInference:
    """Return the outputs and the strengths of the rules; `previous` has the previous outputs."""
    bumped_false = bounds.image(terms.rectangle, bumped, -0.5, 0.5)
    bumped_true = bounds.image(terms.rectangle, bumped, 0.5, 1.5)
    picking_up_false = bounds.image(terms.rectangle, picking_up, -0.5, 0.5)
    picking_up_true = bounds.image(terms.rectangle, picking_up, 0.5, 1.5)
    people_at_container_nobody = bounds.image(terms.ramp, people_at_container, 1.0, 0.0)
    people_at_container_one = bounds.image(terms.triangle, people_at_container, 0.0, 1.0, 2.0)
    people_at_container_several = bounds.image(terms.ramp, people_at_container, 1.0, 2.0)
    container_load_empty = bounds.image(terms.rectangle, container_load, -0.5, 0.5)
    person_distance_close = bounds.image(terms.ramp, person_distance, 2.5, 1.5)
    order_open_false = bounds.image(terms.rectangle, order_open, -0.5, 0.5)
    order_open_true = bounds.image(terms.rectangle, order_open, 0.5, 1.5)
    loaded_false = bounds.image(terms.rectangle, loaded, -0.5, 0.5)
    loaded_true = bounds.image(terms.rectangle, loaded, 0.5, 1.5)
    battery_level_empty = bounds.image(terms.ramp, battery_level, 30.0, 10.0)
    battery_level_full = bounds.image(terms.ramp, battery_level, 10.0, 30.0)
    battery_level_scarce = bounds.image(terms.ramp, battery_level, 45.0, 30.0)
    battery_level_charged = bounds.image(terms.ramp, battery_level, 70.0, 95.0)
    charging_false = bounds.image(terms.rectangle, charging, -0.5, 0.5)
    charging_true = bounds.image(terms.rectangle, charging, 0.5, 1.5)
    battery_drain_fast = bounds.image(terms.ramp, battery_drain, 5.0, 7.0)
    rule_1 = bumped_true
    rule_2 = bounds.norm(norms.minimum, picking_up_true, people_at_container_several)
    rule_3 = bounds.times(0.5, bounds.norm(norms.minimum, bounds.norm(norms.minimum, picking_up_true, people_at_container_one), bounds.hedge(hedges.not_, container_load_empty)))
    rule_4 = bounds.norm(norms.minimum, bounds.norm(norms.minimum, bumped_false, picking_up_true), people_at_container_one)
    rule_5 = bounds.norm(norms.minimum, bounds.norm(norms.minimum, bounds.norm(norms.minimum, bumped_false, picking_up_true), people_at_container_nobody), person_distance_close)
    rule_6 = bounds.norm(norms.minimum, bounds.norm(norms.minimum, bounds.norm(norms.minimum, bumped_false, picking_up_true), people_at_container_nobody), bounds.hedge(hedges.not_, person_distance_close))
    rule_7 = bounds.norm(norms.minimum, bumped_false, picking_up_false)
    rule_8 = order_open_false
    rule_9 = bounds.norm(norms.minimum, order_open_true, loaded_true)
    rule_10 = bounds.norm(norms.minimum, order_open_true, loaded_false)
    rule_11 = battery_level_empty
    rule_12 = bounds.norm(norms.minimum, charging_true, bounds.hedge(hedges.not_, battery_level_charged))
    rule_13 = bounds.norm(norms.minimum, bounds.norm(norms.minimum, charging_false, battery_drain_fast), battery_level_scarce)
    rule_14 = bounds.norm(norms.minimum, bounds.norm(norms.minimum, bounds.norm(norms.minimum, battery_level_full, charging_false), battery_drain_fast), bounds.hedge(hedges.not_, battery_level_scarce))
    rule_15 = bounds.norm(norms.minimum, bounds.norm(norms.minimum, battery_level_full, charging_false), bounds.hedge(hedges.not_, battery_drain_fast))
    rule_16 = bounds.norm(norms.minimum, charging_true, battery_level_charged)
    safety = bounded_outputs.integral(SAFETY, (rule_1, rule_2, rule_3, rule_4, rule_5, rule_6, rule_7))
    safety = bounds.clipped(safety, 0.0, 1.0)
    mission_completion = bounded_outputs.integral(MISSION_COMPLETION, (rule_8, rule_9, rule_10))
    mission_completion = bounds.clipped(mission_completion, 0.0, 1.0)
    power_autonomy = bounded_outputs.integral(POWER_AUTONOMY, (rule_11, rule_12, rule_13, rule_14, rule_15, rule_16))
    power_autonomy = bounds.clipped(power_autonomy, 0.0, 1.0)
    return BoundedInference((safety, mission_completion, power_autonomy), (rule_1, rule_2, rule_3, rule_4, rule_5, rule_6, rule_7, rule_8, rule_9, rule_10, rule_11, rule_12, rule_13, rule_14, rule_15, rule_16))
