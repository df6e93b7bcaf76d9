"""Both stages as a function of the known inputs: worse ends, unknown metrics, evidence."""

from __future__ import annotations

import itertools
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.logic import Value
from codra_dsl.runtime.loops.analysis import MAX_BOXES, assess, infer
from codra_dsl.runtime.loops.fuzzy.bounds import Bounds, End
from codra_dsl.runtime.loops.observations import Observation
from tests.runtime.loops.shop import ACTIONS_STAGE, LOADS, MAPE, METRICS, METRICS_STAGE, module_of, stage

NAMES = ("person_distance", "battery_level", "battery_drain", "container_load")
GAPS = """Engine: gaps
InputVariable: person_distance
  range: 0.0 10.0
  term: close Ramp 2.5 1.5
  term: far Ramp 5.0 6.0
OutputVariable: safety
  range: 0.0 1.0
  defuzzifier: Centroid 100
  aggregation: Maximum
  term: low Ramp 0.6 0.2
  term: high Ramp 0.4 0.8
RuleBlock: safety
  conjunction: Minimum
  disjunction: Maximum
  implication: Minimum
  activation: General
  rule: if person_distance is close then safety is low
  rule: if person_distance is far then safety is high
"""


def scene(*values: Value | None, stamps_s: tuple[float, ...] = (1.0, 2.0, 3.0, 4.0)) -> dict[str, Observation]:
    """Return observations in the order of NAMES."""
    rows = zip(NAMES, values, stamps_s, strict=True)
    return {
        name: Observation(variable=name) if value is None else Observation(variable=name, value=value, evidence_s=at_s)
        for name, value, at_s in rows
    }


scenes = st.tuples(st.floats(0, 10), st.floats(0, 100), st.floats(0, 5), st.sampled_from(LOADS))


@given(scenes)
def test_with_known_inputs_both_stages_equal_the_engines(values: tuple[float, float, float, str]) -> None:
    assessment = assess(MAPE, scene(*values))
    safety, autonomy = METRICS_STAGE.infer(*values[:3]).values
    assert (assessment.metrics.value("safety"), assessment.metrics.value("power_autonomy")) == (safety, autonomy)
    weights = ACTIONS_STAGE.infer(safety, autonomy, float(LOADS.index(values[3]))).values
    assert tuple(assessment.weights().values()) == weights


@given(scenes, st.sets(st.integers(0, 2), min_size=1), st.lists(scenes, min_size=1, max_size=5))
def test_an_unknown_input_counts_as_its_worst_possible_value(
    values: tuple[float, float, float, str], unknown: set[int], others: list[tuple[float, float, float, str]]
) -> None:
    partly = [None if index in unknown else value for index, value in enumerate(values)]
    stage_result = infer(METRICS_STAGE, scene(*partly))
    for other in others:
        mixed = [other[index] if index in unknown else value for index, value in enumerate(values)]
        known = infer(METRICS_STAGE, scene(*mixed))
        for metric in ("safety", "power_autonomy"):
            worst, value = stage_result.value(metric), known.value(metric)
            assert worst is not None
            assert value is not None
            assert worst <= value + 1e-9
            assert next(output.bounds for output in stage_result.outputs if output.name == metric).holds(value)


def test_the_worse_end_of_an_unknown_distance_is_that_of_a_close_person() -> None:
    stage_result = infer(METRICS_STAGE, scene(None, 80.0, 0.5, "empty"))
    assert stage_result.value("safety") == pytest.approx(0.5, abs=0.02)
    assert stage_result.value("power_autonomy") == infer(METRICS_STAGE, scene(6.0, 80.0, 0.5, "empty")).value(
        "power_autonomy"
    )


def test_a_metric_whose_worse_end_is_high_counts_its_high_end() -> None:
    outputs = tuple(replace(output, worse=End.HIGH) for output in METRICS_STAGE.outputs)
    stage_result = infer(replace(METRICS_STAGE, outputs=outputs), scene(None, 80.0, 0.5, "empty"))
    assert stage_result.value("safety") == pytest.approx(0.783, abs=0.02)


def test_an_unknown_enum_counts_as_one_of_its_members_and_as_no_number_between() -> None:
    metrics = {"safety": 0.78, "power_autonomy": 0.78}
    known = {name: Observation(variable=name, value=value, evidence_s=0.0) for name, value in metrics.items()}
    result_of_unknown_load = infer(ACTIONS_STAGE, {**known, "container_load": Observation(variable="container_load")})
    results_of_known_loads = [
        infer(ACTIONS_STAGE, {**known, "container_load": Observation(variable="container_load", value=load)})
        for load in LOADS
    ]
    weights = [one.value("deliver") or 0.0 for one in results_of_known_loads]
    (deliver,) = (one.bounds for one in result_of_unknown_load.outputs if one.name == "deliver")
    assert not deliver.may_be_unknown
    assert deliver.low == pytest.approx(min(map(float, weights)), abs=1e-6)
    assert deliver.high == pytest.approx(max(map(float, weights)), abs=1e-6)


@pytest.mark.parametrize(("distance", "is_known"), [(1.0, True), (3.5, False), (8.0, True), (None, False)])
def test_where_possibly_no_rule_acts_the_metric_is_unknown(distance: float | None, is_known: bool) -> None:
    gaps = stage(GAPS, {}, {})
    stage_result = infer(gaps, scene(distance, 80.0, 0.5, "empty"))
    assert (stage_result.value("safety") is not None) is is_known


def test_an_unknown_input_with_a_single_possible_number_counts_as_that_number() -> None:
    """This also holds if possibly no rule acts, so that boxes would be cut: there is no range to cut."""
    gaps = stage(GAPS, {}, {})
    narrow = tuple(
        replace(model_input, range=Bounds(3.5, 3.5)) if model_input.variable == "person_distance" else model_input
        for model_input in gaps.inputs
    )
    stage_result = infer(replace(gaps, inputs=narrow), scene(None, 80.0, 0.5, "empty"))
    assert stage_result.value("safety") is None


def test_an_unknown_metric_widens_only_the_weights_that_depend_on_it() -> None:
    model = replace(MAPE, metrics=stage(GAPS, {}, {}))
    seen = {**scene(3.5, 80.0, 0.5, "full"), "power_autonomy": Observation(variable="power_autonomy", value=0.2)}
    assessment = assess(model, seen)
    assert assessment.scene["safety"].value is None
    bounds = {output.name: output.bounds for output in assessment.actions.outputs}
    assert bounds["dock"].low == bounds["dock"].high
    assert bounds["start"].low < bounds["start"].high


@given(st.permutations([1.0, 2.0, 3.0, 4.0]))
def test_evidence_is_as_old_as_the_oldest_input_that_the_rules_read(stamps_s: list[float]) -> None:
    assessment = assess(MAPE, scene(6.0, 80.0, 0.5, "empty", stamps_s=tuple(stamps_s)))
    stamps = {output.name: output.evidence_s for output in (*assessment.metrics.outputs, *assessment.actions.outputs)}
    assert stamps == {
        "safety": stamps_s[0],
        "power_autonomy": min(stamps_s[1:3]),
        "deliver": min(stamps_s),
        "start": stamps_s[0],
        "dock": min(stamps_s[1:3]),
    }


def test_any_number_of_unknown_inputs_is_cut_into_few_boxes() -> None:
    calls = []
    module = module_of(METRICS)

    def counted(*inputs: object) -> object:
        calls.append(inputs)
        return module.infer_bounds(*inputs)

    for unknown in itertools.product([False, True], repeat=3):
        calls.clear()
        values = [None if is_unknown else 1.0 for is_unknown in unknown]
        infer(replace(METRICS_STAGE, infer_bounds=counted), scene(*values, "empty"))  # type: ignore[arg-type]
        assert len(calls) <= 2 * (MAX_BOXES + 1) + 1
