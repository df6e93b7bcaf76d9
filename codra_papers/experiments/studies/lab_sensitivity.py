"""`lab-sensitivity`: in which laboratories, and with which numbers in a spec, does the advantage vanish?

The numbers to vary are read from the spec and not listed here, so that added numbers are varied as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import pi

from codra_dsl.integrations.inspection import read_spec
from codra_papers.experiments.campaign.cells import interval, plain_table
from codra_papers.experiments.campaign.document import Document, Drawing, Section, Table, Words
from codra_papers.experiments.campaign.experiment import Experiment, Settings
from codra_papers.experiments.campaign.statistics import Estimate
from codra_papers.experiments.lab.arms import NAIVE, PRECONDITIONS, Arm
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.lab.spec_variants import SpecEdit
from codra_papers.experiments.lab.trials import Trial
from codra_papers.experiments.studies.beyond.arm_comparison import (
    LIDS_AND_LATCHES,
    ArmComparison,
    arm_comparison,
    arm_comparisons_as_data,
    ratios,
    reported_seeds,
    runs_sentence,
)
from codra_papers.experiments.studies.beyond.curves import Curve, Panel, differences, panels, point_at
from codra_papers.experiments.studies.beyond.parameters import Parameter, parameters
from codra_papers.experiments.studies.beyond.workloads import Tending
from codra_papers.experiments.studies.robustness.findings import vision_algorithms
from codra_papers.lab.mission import CENTRIFUGE, PCR_CYCLER
from codra_papers.lab.simulator.laboratory import LABORATORY, Laboratory

WORK = Tending(machines=(CENTRIFUGE, PCR_CYCLER))

STRONGEST = 8
"""How many numbers of the spec the picture shows: those that change the difference to naive observers most."""


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
        """Return the beginning of the names of the trials in this laboratory."""
        return f"{self.axis} {self.value:g}"


TAGS, NOISE, LIGHT, LAYOUT = "tag size", "noise", "light", "layout"

_NOMINAL = {TAGS: 1.0, NOISE: LABORATORY.noise_greys, LIGHT: 1.0, LAYOUT: 0.0}

_ACROSS = {
    TAGS: "tags, times as large",
    NOISE: "deviation of the camera's noise in greys",
    LIGHT: "light, 1 is an ordinary day",
    LAYOUT: "layout: 0 as it is, 1 side by side, 2 turned",
}

_SIDE_BY_SIDE = LABORATORY.with_machine_at(PCR_CYCLER, 4.2, 5.2, -pi / 2)
_TURNED = LABORATORY.with_machine_at(PCR_CYCLER, 5.3, 1.6, pi).with_machine_at(CENTRIFUGE, 0.7, 4.0, 0.0)

VARIATIONS = (
    *(Variation(axis=TAGS, value=scale, laboratory=LABORATORY.with_tags(scale)) for scale in (0.5, 0.75)),
    *(Variation(axis=NOISE, value=greys, laboratory=replace(LABORATORY, noise_greys=greys)) for greys in (10.0, 25.0)),
    *(Variation(axis=LIGHT, value=light, laboratory=replace(LABORATORY, light=light)) for light in (0.1, 0.3)),
    Variation(axis=LAYOUT, value=1.0, laboratory=_SIDE_BY_SIDE),
    Variation(axis=LAYOUT, value=2.0, laboratory=_TURNED),
)

_AS_IT_IS = "as it is"

_ROTOR = "_rotor"
"""The end of the names of rotor variables, which are left out: no rotor is turned here."""

_NOTE = (
    "The robot tends the centrifuge and the PCR-cycler, and looks by itself for each of its decisions. Each laboratory "
    "differs from the protocol's laboratory in one property. In each, observers with preconditions and naive observers "
    "watch the same frames. In the unchanged laboratory, each number of the spec is also halved, and made one and a "
    "half times as large, each in an arm of its own; counts are rounded up. No rotor is turned, so the numbers for "
    "rotors are left out."
)


def arms(settings: Settings) -> tuple[Arm, ...]:
    """Return naive observers, the unchanged spec, and the spec with each of its numbers smaller and larger."""
    spec = read_spec(settings.spec)
    changed = [
        PRECONDITIONS.with_edit(f"{parameter.name} {times}", edit)
        for parameter in parameters(spec, besides=_ROTOR)
        for times, edit in _changes(parameter)
        if edit(spec) != spec
    ]
    return (NAIVE, PRECONDITIONS, *changed)


def _changes(parameter: Parameter) -> Sequence[tuple[str, SpecEdit]]:
    return (("x 0.5", parameter.smaller), ("x 1.5", parameter.larger))


def trials(settings: Settings) -> Sequence[Trial]:
    """Return, for each seed, a run in each laboratory, and one with all arms in the unchanged laboratory."""
    changed = arms(settings)
    return [
        trial
        for seed in reported_seeds(settings)
        for trial in (
            Trial(name=f"{_AS_IT_IS} {seed}", spec=settings.spec, seed=seed, arms=changed, work=WORK),
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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Findings:
    """The content of the report.

    Attributes:
        by_name: the comparisons of the arms with naive observers in each laboratory, naive first. The key is the name
            of a variation, or of the unchanged laboratory.
        strongest: the numbers that change the advantage most, the strongest first.
    """

    by_name: Mapping[str, Sequence[ArmComparison]]
    strongest: Sequence[Parameter]

    def of(self, name: str, arm: str) -> ArmComparison | None:
        """Return the comparison of an arm in a laboratory; None if the laboratory was run without this arm."""
        return next((comparison for comparison in self.by_name[name] if comparison.arm == arm), None)

    def advantage(self, name: str, arm: str = PRECONDITIONS.name) -> Estimate | None:
        """Return how much better an arm is than naive observers, by the ratio."""
        comparison = self.of(name, arm)
        return None if comparison is None else comparison.paper_difference


def judge(settings: Settings, outcomes: Mapping[str, Outcome]) -> Document:
    """Return the report on the outcomes of `trials`.

    Raises:
        SpecError: if the spec has errors.
    """
    findings = _findings(settings, outcomes)
    return Document(
        title="lab-sensitivity: where the advantage vanishes",
        summary=(*_summary(findings), runs_sentence(list(outcomes.values()))),
        sections=tuple(_sections(findings)),
        results={name: arm_comparisons_as_data(comparisons) for name, comparisons in findings.by_name.items()},
    )


def _findings(settings: Settings, outcomes: Mapping[str, Outcome]) -> _Findings:
    spec = read_spec(settings.spec)
    vision = vision_algorithms(spec)
    by_name: dict[str, Sequence[ArmComparison]] = {}
    for name in (_AS_IT_IS, *(variation.name for variation in VARIATIONS)):
        runs = [outcome for key, outcome in outcomes.items() if key.rpartition(" ")[0] == name]
        by_name[name] = [arm_comparison(runs, LIDS_AND_LATCHES, arm, NAIVE.name, vision) for arm in runs[0].arms]
    all_findings = _Findings(by_name=by_name, strongest=())
    ordered_parameters = sorted(
        parameters(spec, besides=_ROTOR), key=lambda parameter: -_strength(all_findings, parameter)
    )
    return replace(all_findings, strongest=ordered_parameters[:STRONGEST])


def _strength(findings: _Findings, parameter: Parameter) -> float:
    """Return the largest change of the advantage that a parameter causes."""
    nominal = _value(findings.advantage(_AS_IT_IS))
    advantages = (findings.advantage(_AS_IT_IS, f"{parameter.name} {times}") for times, _ in _changes(parameter))
    return max((abs(_value(advantage) - nominal) for advantage in advantages if advantage is not None), default=0.0)


def _value(estimate: Estimate | None) -> float:
    return 0.0 if estimate is None or estimate.value is None else estimate.value


def _summary(findings: _Findings) -> Iterator[str]:
    nominal = findings.advantage(_AS_IT_IS)
    if nominal is not None:
        yield f"In the unchanged laboratory, preconditions minus naive, ratio of lids and latches: {interval(nominal)}."
    for kind, estimates in (
        ("laboratories", _laboratory_advantages(findings)),
        ("numbers of the spec", _number_advantages(findings)),
    ):
        vanished = [f"{name} ({interval(estimate)})" for name, estimate in estimates if not estimate.is_positive]
        yield (
            f"Of {len(estimates)} {kind}, the interval of the advantage is not completely above zero in {len(vanished)}"
            f"{': ' if vanished else ''}{'; '.join(vanished)}."
        )


def _laboratory_advantages(findings: _Findings) -> Sequence[tuple[str, Estimate]]:
    advantages = ((variation.name, findings.advantage(variation.name)) for variation in VARIATIONS)
    return [(name, estimate) for name, estimate in advantages if estimate is not None]


def _number_advantages(findings: _Findings) -> Sequence[tuple[str, Estimate]]:
    names = (f"{parameter.name} {times}" for parameter in findings.strongest for times, _ in _changes(parameter))
    advantages = ((name, findings.advantage(_AS_IT_IS, name)) for name in names)
    return [(name, estimate) for name, estimate in advantages if estimate is not None]


def _sections(findings: _Findings) -> Iterator[Section]:
    yield Section(title="What was varied", parts=(Words(text=_NOTE),))
    yield Section(title="Laboratories", parts=(_curves(findings), _laboratory_table(findings)))
    caption = (
        f"The {len(findings.strongest)} numbers of the spec that change the advantage most, at half and one and a "
        "half: ratio of lids and latches, minus that of naive observers, with 95 % intervals over paired runs."
    )
    number_drawing = differences(_number_advantages(findings), "ratio, minus naive", caption)
    yield Section(title="Numbers of the spec", parts=(number_drawing, _number_table(findings)))


def _curves(findings: _Findings) -> Drawing:
    axis_panels = [
        Panel(
            title=axis,
            across=_ACROSS[axis],
            nominal=_NOMINAL[axis],
            curves=[
                Curve(
                    name="preconditions minus naive",
                    points=[point_at(value, findings.advantage(name)) for value, name in _laboratories_on_axis(axis)],
                )
            ],
        )
        for axis in _ACROSS
    ]
    caption = "The ratio of lids and latches minus that of naive observers. The grey line: the unchanged laboratory."
    return panels(axis_panels, "ratio, minus naive", caption)


def _laboratories_on_axis(axis: str) -> Sequence[tuple[float, str]]:
    """Return the laboratories of an axis, including that of the protocol, in order."""
    return sorted(
        [
            (_NOMINAL[axis], _AS_IT_IS),
            *((variation.value, variation.name) for variation in VARIATIONS if variation.axis == axis),
        ]
    )


_HEADER = ("", "arm", "ratio", "strict ratio", "ratio, minus naive", "strict, minus naive", "wrong at decisions")


def _laboratory_table(findings: _Findings) -> Table:
    both = (NAIVE.name, PRECONDITIONS.name)
    rows = [
        (name, *ratios(comparison), comparison.answers.wrong)
        for name in findings.by_name
        for comparison in (findings.of(name, arm) for arm in both)
        if comparison is not None
    ]
    return plain_table("Lids and latches in each laboratory, over all runs.", _HEADER, rows)


def _number_table(findings: _Findings) -> Table:
    rows = [("as it is", *ratios(comparison), comparison.answers.wrong) for comparison in findings.by_name[_AS_IT_IS]]
    return plain_table("Lids and latches with other numbers in the spec, over all runs.", _HEADER, rows)


EXPERIMENT = Experiment(
    name="lab-sensitivity",
    question="In which laboratories, and with which numbers in the spec, does the advantage over naive vanish?",
    seeds=4,
    trials=trials,
    judge=judge,
)
