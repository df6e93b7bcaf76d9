"""`lab-sensitivity`: in which laboratories, and with which numbers in a spec, does the advantage vanish?

The numbers to vary are read from the spec and not listed here, so that added numbers are varied as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import pi

from codra_dsl.integrations.inspection import read_spec
from codra_papers.experiments.campaign.cells import interval, plain_table
from codra_papers.experiments.campaign.document import Cell, Document, Drawing, Section, Table, Words
from codra_papers.experiments.campaign.experiment import Experiment, Settings
from codra_papers.experiments.campaign.seeds import reported_seeds as protocol_seeds
from codra_papers.experiments.campaign.statistics import Estimate
from codra_papers.experiments.lab.algorithms import vision_algorithms
from codra_papers.experiments.lab.arms import NAIVE, PRECONDITIONS, Arm
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.lab.run import Work
from codra_papers.experiments.lab.spec_variants import SpecEdit
from codra_papers.experiments.lab.trials import Trial
from codra_papers.experiments.studies.beyond.arm_comparison import (
    LIDS_AND_LATCHES,
    RATIO_HEADER,
    ArmComparison,
    arm_comparison,
    arm_comparisons_as_data,
    ratio_cells,
    reported_seeds,
    runs_sentence,
)
from codra_papers.experiments.studies.beyond.curves import Curve, Panel, differences, panels, point_at
from codra_papers.experiments.studies.beyond.parameters import Parameter, parameters
from codra_papers.experiments.studies.beyond.workloads import Tending
from codra_papers.experiments.studies.factors.design import Lid, factorial_trials
from codra_papers.experiments.studies.factors.report import factorial_report
from codra_papers.experiments.studies.robustness.findings import MEASURES_NOTE
from codra_papers.lab.mission import CENTRIFUGE, PCR_CYCLER
from codra_papers.lab.simulator.laboratory import LABORATORY, Laboratory

WORK = Tending(machines=(CENTRIFUGE, PCR_CYCLER))

CELL_SEEDS_PER_SEED = 3
"""How many seeds the cells of the factorial design have for each seed of the laboratories."""

STRONGEST_COUNT = 8
"""How many numbers of the spec the picture shows. These numbers change the difference to naive observers most."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Variation:
    """A laboratory that differs from that of the protocol in one property.

    Attributes:
        axis: the property.
        value: the value of the property in pictures.
    """

    axis: str
    value: float
    laboratory: Laboratory

    @property
    def name(self) -> str:
        """Return the prefix of the names of the trials in this laboratory."""
        return f"{self.axis} {self.value:g}"


TAGS, NOISE, LIGHT, LAYOUT = "tag size", "noise", "light", "layout"

_NOMINAL_VALUES = {TAGS: 1.0, NOISE: LABORATORY.noise_greys, LIGHT: 1.0, LAYOUT: 0.0}

_AXIS_LABELS = {
    TAGS: "tags, times as large",
    NOISE: "deviation of the camera's noise in greys",
    LIGHT: "light, 1 is an ordinary day",
    LAYOUT: "layout: 0 as it is, 1 side by side, 2 turned",
}

_SIDE_BY_SIDE_LABORATORY = LABORATORY.with_machine_at(PCR_CYCLER, 4.2, 5.2, -pi / 2)
_TURNED_LABORATORY = LABORATORY.with_machine_at(PCR_CYCLER, 5.3, 1.6, pi).with_machine_at(CENTRIFUGE, 0.7, 4.0, 0.0)

VARIATIONS = (
    *(Variation(axis=TAGS, value=scale, laboratory=LABORATORY.with_tags(scale)) for scale in (0.5, 0.75)),
    *(Variation(axis=NOISE, value=greys, laboratory=replace(LABORATORY, noise_greys=greys)) for greys in (10.0, 25.0)),
    *(Variation(axis=LIGHT, value=light, laboratory=replace(LABORATORY, light=light)) for light in (0.1, 0.3)),
    Variation(axis=LAYOUT, value=1.0, laboratory=_SIDE_BY_SIDE_LABORATORY),
    Variation(axis=LAYOUT, value=2.0, laboratory=_TURNED_LABORATORY),
)

_UNCHANGED_NAME = "as it is"

_ROTOR_SUFFIX = "_rotor"
"""The suffix of the names of the algorithms for rotors. Their numbers are left out, because no rotor is turned."""

_NOTE = (
    "The robot tends the centrifuge and the PCR-cycler, and looks by itself for each of its decisions. Each laboratory "
    "differs from the protocol's laboratory in one property. In each laboratory, observers with preconditions and "
    "naive observers watch the same frames. In the unchanged laboratory, there are two more arms for each number of "
    "the spec: one halves the number, the other multiplies it by 1.5. Counts are rounded up. No rotor is turned, so "
    "the numbers for rotors are left out."
)


def arms(settings: Settings) -> tuple[Arm, ...]:
    """Return naive observers, the arm with the unchanged spec, and two arms with a changed value of each number."""
    spec = read_spec(settings.spec)
    changed_arms = [
        PRECONDITIONS.with_edit(f"{parameter.name} {times}", edit)
        for parameter in parameters(spec, excluded_suffix=_ROTOR_SUFFIX)
        for times, edit in _edits_by_factor(parameter)
        if edit(spec) != spec
    ]
    return (NAIVE, PRECONDITIONS, *changed_arms)


def _edits_by_factor(parameter: Parameter) -> Sequence[tuple[str, SpecEdit]]:
    return (("x 0.5", parameter.smaller_edit), ("x 1.5", parameter.larger_edit))


def trials(settings: Settings) -> Sequence[Trial]:
    """Return, for each seed, a run in each varied laboratory, and a run with all arms in the unchanged laboratory.

    For each seed there are also `CELL_SEEDS_PER_SEED` runs, in a quick report one run, in each cell of the factorial
    design.
    """
    all_arms = arms(settings)
    runs = [
        trial
        for seed in reported_seeds(settings)
        for trial in (
            Trial(name=f"{_UNCHANGED_NAME} {seed}", spec=settings.spec, seed=seed, arms=all_arms, work=WORK),
            *(
                Trial(
                    name=f"{variation.name} {seed}",
                    spec=settings.spec,
                    seed=seed,
                    arms=(NAIVE, PRECONDITIONS),
                    laboratory=variation.laboratory,
                    work=WORK,
                )
                for variation in VARIATIONS
            ),
        )
    ]
    cell_seed_count = settings.seeds * (1 if settings.is_quick else CELL_SEEDS_PER_SEED)
    factorial_seeds = protocol_seeds(EXPERIMENT.name, cell_seed_count)
    return [*runs, *factorial_trials(settings.spec, factorial_seeds, _return_visit)]


def _return_visit(lid: Lid) -> Work:
    return Tending(machines=(CENTRIFUGE, PCR_CYCLER, CENTRIFUGE), leaves_lids_open=lid is Lid.OPEN)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Findings:
    """The content of the report.

    Attributes:
        comparisons_by_laboratory: for each laboratory, the comparisons of its arms with naive observers; the naive arm
            is the first. The key is the name of a variation, or of the unchanged laboratory.
        strongest_parameters: the parameters of the spec that change the advantage most, in descending order.
    """

    comparisons_by_laboratory: Mapping[str, Sequence[ArmComparison]]
    strongest_parameters: Sequence[Parameter]

    def comparison_of(self, name: str, arm: str) -> ArmComparison | None:
        """Return the comparison of an arm in a laboratory, or None if the laboratory has no run with this arm."""
        return next((comparison for comparison in self.comparisons_by_laboratory[name] if comparison.arm == arm), None)

    def advantage(self, name: str, arm: str = PRECONDITIONS.name) -> Estimate | None:
        """Return the ratio of an arm minus the ratio of naive observers, or None if the arm has no such difference."""
        comparison = self.comparison_of(name, arm)
        return None if comparison is None else comparison.paper_difference


def judge(settings: Settings, outcomes: Mapping[str, Outcome]) -> Document:
    """Return the report on the outcomes of `trials`.

    Raises:
        SpecError: if the spec has errors.
    """
    findings = _findings(settings, outcomes)
    factorial = factorial_report(outcomes, vision_algorithms(read_spec(settings.spec)))
    return Document(
        title="lab-sensitivity: where the advantage vanishes",
        summary=(*_summary(findings), *factorial.summary, runs_sentence(list(outcomes.values()))),
        sections=(*_sections(findings), factorial.section),
        results={
            **{
                name: arm_comparisons_as_data(comparisons)
                for name, comparisons in findings.comparisons_by_laboratory.items()
            },
            "factors": factorial.results,
        },
    )


def _findings(settings: Settings, outcomes: Mapping[str, Outcome]) -> _Findings:
    spec = read_spec(settings.spec)
    slot_algorithms = vision_algorithms(spec)
    comparisons_by_laboratory: dict[str, Sequence[ArmComparison]] = {}
    for name in (_UNCHANGED_NAME, *(variation.name for variation in VARIATIONS)):
        runs = [outcome for key, outcome in outcomes.items() if key.rpartition(" ")[0] == name]
        comparisons_by_laboratory[name] = [
            arm_comparison(runs, LIDS_AND_LATCHES, arm, NAIVE.name, slot_algorithms) for arm in runs[0].arms
        ]
    all_findings = _Findings(comparisons_by_laboratory=comparisons_by_laboratory, strongest_parameters=())
    ordered_parameters = sorted(
        parameters(spec, excluded_suffix=_ROTOR_SUFFIX), key=lambda parameter: -_strength(all_findings, parameter)
    )
    return replace(all_findings, strongest_parameters=ordered_parameters[:STRONGEST_COUNT])


def _strength(findings: _Findings, parameter: Parameter) -> float:
    """Return the largest change of the advantage that a parameter causes."""
    nominal_advantage = _value(findings.advantage(_UNCHANGED_NAME))
    advantages = (
        findings.advantage(_UNCHANGED_NAME, f"{parameter.name} {times}") for times, _ in _edits_by_factor(parameter)
    )
    return max(
        (abs(_value(advantage) - nominal_advantage) for advantage in advantages if advantage is not None), default=0.0
    )


def _value(estimate: Estimate | None) -> float:
    return 0.0 if estimate is None or estimate.value is None else estimate.value


def _summary(findings: _Findings) -> Iterator[str]:
    nominal_advantage = findings.advantage(_UNCHANGED_NAME)
    if nominal_advantage is not None:
        yield (
            "In the unchanged laboratory, preconditions minus naive, ratio of lids and latches:"
            f" {interval(nominal_advantage)}."
        )
    for kind, estimates in (
        ("laboratories", _laboratory_advantages(findings)),
        ("changes of the spec's numbers", _number_advantages(findings)),
    ):
        vanished_texts = [f"{name} ({interval(estimate)})" for name, estimate in estimates if not estimate.is_positive]
        yield (
            f"Of {len(estimates)} {kind}, the interval of the advantage is not completely above zero in"
            f" {len(vanished_texts)}{': ' if vanished_texts else ''}{'; '.join(vanished_texts)}."
        )


def _laboratory_advantages(findings: _Findings) -> Sequence[tuple[str, Estimate]]:
    advantages = ((variation.name, findings.advantage(variation.name)) for variation in VARIATIONS)
    return [(name, estimate) for name, estimate in advantages if estimate is not None]


def _number_advantages(findings: _Findings) -> Sequence[tuple[str, Estimate]]:
    names = (
        f"{parameter.name} {times}"
        for parameter in findings.strongest_parameters
        for times, _ in _edits_by_factor(parameter)
    )
    advantages = ((name, findings.advantage(_UNCHANGED_NAME, name)) for name in names)
    return [(name, estimate) for name, estimate in advantages if estimate is not None]


def _sections(findings: _Findings) -> Iterator[Section]:
    yield Section(title="What was varied", parts=(Words(text=_NOTE),))
    yield Section(title="Laboratories", parts=(_curves(findings), _laboratory_table(findings)))
    caption = (
        f"The {len(findings.strongest_parameters)} numbers of the spec that change the advantage most, multiplied by "
        "0.5 and by 1.5. Each row shows the ratio of lids and latches minus that of naive observers, with the 95 % "
        "interval over paired runs."
    )
    number_drawing = differences(_number_advantages(findings), "ratio, minus naive", caption)
    yield Section(title="Numbers of the spec", parts=(number_drawing, _number_table(findings)))


def _curves(findings: _Findings) -> Drawing:
    axis_panels = [
        Panel(
            title=axis,
            x_label=_AXIS_LABELS[axis],
            nominal_x=_NOMINAL_VALUES[axis],
            curves=[
                Curve(
                    name="preconditions minus naive",
                    points=[point_at(value, findings.advantage(name)) for value, name in _laboratories_on_axis(axis)],
                )
            ],
        )
        for axis in _AXIS_LABELS
    ]
    caption = (
        "The ratio of lids and latches minus that of naive observers. The grey line marks the unchanged laboratory."
    )
    return panels(axis_panels, "ratio, minus naive", caption)


def _laboratories_on_axis(axis: str) -> Sequence[tuple[float, str]]:
    """Return the laboratories of an axis as (value, name), in ascending order, including that of the protocol."""
    return sorted(
        [
            (_NOMINAL_VALUES[axis], _UNCHANGED_NAME),
            *((variation.value, variation.name) for variation in VARIATIONS if variation.axis == axis),
        ]
    )


_TABLE_NOTE = f"{MEASURES_NOTE} Differences are relative to naive observers."

_HEADER = ("", "arm", *RATIO_HEADER, "late s", "wrong at decisions", "of these, late")


def _cells(comparison: ArmComparison) -> Sequence[Cell]:
    return (
        *ratio_cells(comparison),
        round(comparison.causes.changed_since_s, 1),
        comparison.answers.wrong,
        comparison.answers.late,
    )


def _laboratory_table(findings: _Findings) -> Table:
    arm_names = (NAIVE.name, PRECONDITIONS.name)
    rows = [
        (name, *_cells(comparison))
        for name in findings.comparisons_by_laboratory
        for comparison in (findings.comparison_of(name, arm) for arm in arm_names)
        if comparison is not None
    ]
    return plain_table(f"Lids and latches in each laboratory, over all runs. {_TABLE_NOTE}", _HEADER, rows)


def _number_table(findings: _Findings) -> Table:
    rows = [("as it is", *_cells(comparison)) for comparison in findings.comparisons_by_laboratory[_UNCHANGED_NAME]]
    return plain_table(f"Lids and latches with other numbers in the spec, over all runs. {_TABLE_NOTE}", _HEADER, rows)


EXPERIMENT = Experiment(
    name="lab-sensitivity",
    question="In which laboratories, and with which numbers in the spec, does the advantage over naive vanish?",
    seeds=4,
    trials=trials,
    judge=judge,
)
