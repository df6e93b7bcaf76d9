"""`lab-sensitivity`: in which laboratories, and with which numbers in a spec, does the advantage vanish?"""

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
from codra_papers.experiments.lab.spec_variants import SpecVariant
from codra_papers.experiments.lab.trials import Trial
from codra_papers.experiments.studies.beyond.arm_comparison import (
    LIDS_AND_LATCHES,
    Standing,
    ratios,
    reported_seeds,
    runs_sentence,
    standing,
    standings_as_data,
)
from codra_papers.experiments.studies.beyond.curves import Curve, Panel, at, differences, panels
from codra_papers.experiments.studies.beyond.parameters import Parameter, parameters
from codra_papers.experiments.studies.beyond.workloads import Tending
from codra_papers.experiments.studies.robustness.findings import vision_algorithms
from codra_papers.lab.mission import CENTRIFUGE, PCR_CYCLER
from codra_papers.lab.simulator.laboratory import LABORATORY, Laboratory

WORK = Tending(machines=(CENTRIFUGE, PCR_CYCLER))

STRONGEST = 8
"""So many numbers of the spec are drawn: those that change the difference to naive observers most."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Variation:
    """A laboratory that differs from that of the protocol in one thing.

    Attributes:
        axis: in what.
        value: as it is drawn.
    """

    axis: str
    value: float
    laboratory: Laboratory

    @property
    def name(self) -> str:
        """Return the beginning of the names of its trials."""
        return f"{self.axis} {self.value:g}"


TAGS, NOISE, LIGHT, LAYOUT = "tag size", "noise", "light", "layout"

_NOMINAL = {TAGS: 1.0, NOISE: LABORATORY.noise_greys, LIGHT: 1.0, LAYOUT: 0.0}

_ACROSS = {
    TAGS: "tags, times as large",
    NOISE: "deviation of the camera's noise in greys",
    LIGHT: "light, 1 is an ordinary day",
    LAYOUT: "layout: 0 as it is, 1 side by side, 2 turned",
}

_SIDE_BY_SIDE = LABORATORY.with_standing(PCR_CYCLER, 4.2, 5.2, -pi / 2)
_TURNED = LABORATORY.with_standing(PCR_CYCLER, 5.3, 1.6, pi).with_standing(CENTRIFUGE, 0.7, 4.0, 0.0)

VARIATIONS = (
    *(Variation(axis=TAGS, value=scale, laboratory=LABORATORY.with_tags(scale)) for scale in (0.5, 0.75)),
    *(Variation(axis=NOISE, value=greys, laboratory=replace(LABORATORY, noise_greys=greys)) for greys in (10.0, 25.0)),
    *(Variation(axis=LIGHT, value=light, laboratory=replace(LABORATORY, light=light)) for light in (0.1, 0.3)),
    Variation(axis=LAYOUT, value=1.0, laboratory=_SIDE_BY_SIDE),
    Variation(axis=LAYOUT, value=2.0, laboratory=_TURNED),
)

_AS_IT_IS = "as it is"

_ROTOR = "_rotor"
"""No rotor is turned here."""

_NOTE = (
    "The robot tends the centrifuge and the PCR-cycler, and looks at each of its decisions by itself. Each laboratory "
    "differs from the protocol's in one thing; in it, observers with preconditions and naive ones watch the same "
    "frames. In the laboratory as it is, each number of the spec is also halved and made one and a half times as "
    "large, an arm each; a small whole number is rounded up. No rotor is turned, so its numbers are left out."
)


def arms(settings: Settings) -> tuple[Arm, ...]:
    """Return naive observers, the spec as it stands, and with each of its numbers smaller and larger."""
    spec = read_spec(settings.spec)
    changed = [
        PRECONDITIONS.edited(f"{parameter.name} {times}", edit)
        for parameter in parameters(spec, besides=_ROTOR)
        for times, edit in _changes(parameter)
        if edit(spec) != spec
    ]
    return (NAIVE, PRECONDITIONS, *changed)


def _changes(parameter: Parameter) -> Sequence[tuple[str, SpecVariant]]:
    return (("x 0.5", parameter.smaller), ("x 1.5", parameter.larger))


def trials(settings: Settings) -> Sequence[Trial]:
    """Return, for each seed, a run in each laboratory, and one with all arms in the laboratory as it is."""
    changed = arms(settings)
    return [
        trial
        for seed in reported_seeds(settings)
        for trial in (
            Trial(name=f"{_AS_IT_IS} {seed}", spec=settings.spec, seed=seed, arms=changed, work=WORK),
            *(
                Trial(
                    name=f"{each.name} {seed}",
                    spec=settings.spec,
                    seed=seed,
                    arms=(NAIVE, PRECONDITIONS),
                    laboratory=each.laboratory,
                    work=WORK,
                )
                for each in VARIATIONS
            ),
        )
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Found:
    """What the report tells: how arms stand in each laboratory, naive first, each less naive.

    Attributes:
        by_name: of a variation, or of the laboratory as it is.
        strongest: names of the numbers that change most, the strongest first.
    """

    by_name: Mapping[str, Sequence[Standing]]
    strongest: Sequence[Parameter]

    def of(self, name: str, arm: str) -> Standing | None:
        """Return how an arm stands in a laboratory; None if it is not in it."""
        return next((one for one in self.by_name[name] if one.arm == arm), None)

    def advantage(self, name: str, arm: str = PRECONDITIONS.name) -> Estimate | None:
        """Return how much better an arm is than naive observers, by the ratio."""
        found = self.of(name, arm)
        return None if found is None else found.paper_difference


def judge(settings: Settings, outcomes: Mapping[str, Outcome]) -> Document:
    """Return the report on the outcomes of `trials`.

    Raises:
        SpecError: if the spec has errors.
    """
    found = _found(settings, outcomes)
    return Document(
        title="lab-sensitivity: where the advantage vanishes",
        summary=(*_summary(found), runs_sentence(list(outcomes.values()))),
        sections=tuple(_sections(found)),
        results={name: standings_as_data(told) for name, told in found.by_name.items()},
    )


def _found(settings: Settings, outcomes: Mapping[str, Outcome]) -> _Found:
    spec = read_spec(settings.spec)
    vision = vision_algorithms(spec)
    by_name: dict[str, Sequence[Standing]] = {}
    for name in (_AS_IT_IS, *(each.name for each in VARIATIONS)):
        told = [outcome for key, outcome in outcomes.items() if key.rpartition(" ")[0] == name]
        by_name[name] = [standing(told, LIDS_AND_LATCHES, arm, NAIVE.name, vision) for arm in told[0].arms]
    every = _Found(by_name=by_name, strongest=())
    ordered = sorted(parameters(spec, besides=_ROTOR), key=lambda each: -_strength(every, each))
    return replace(every, strongest=ordered[:STRONGEST])


def _strength(found: _Found, parameter: Parameter) -> float:
    """Return by how much a number changes the advantage at most."""
    nominal = _value(found.advantage(_AS_IT_IS))
    told = (found.advantage(_AS_IT_IS, f"{parameter.name} {times}") for times, _ in _changes(parameter))
    return max((abs(_value(each) - nominal) for each in told if each is not None), default=0.0)


def _value(estimate: Estimate | None) -> float:
    return 0.0 if estimate is None or estimate.value is None else estimate.value


def _summary(found: _Found) -> Iterator[str]:
    nominal = found.advantage(_AS_IT_IS)
    if nominal is not None:
        yield f"In the laboratory as it is, preconditions less naive: ratio {interval(nominal)} of lids and latches."
    for kind, told in (("laboratories", _laboratories(found)), ("numbers of the spec", _numbers(found))):
        gone = [f"{name} ({interval(one)})" for name, one in told if not one.is_positive]
        yield (
            f"Of {len(told)} {kind}, the advantage is not above zero with its whole interval in {len(gone)}"
            f"{': ' if gone else ''}{'; '.join(gone)}."
        )


def _laboratories(found: _Found) -> Sequence[tuple[str, Estimate]]:
    told = ((each.name, found.advantage(each.name)) for each in VARIATIONS)
    return [(name, one) for name, one in told if one is not None]


def _numbers(found: _Found) -> Sequence[tuple[str, Estimate]]:
    names = (f"{each.name} {times}" for each in found.strongest for times, _ in _changes(each))
    told = ((name, found.advantage(_AS_IT_IS, name)) for name in names)
    return [(name, one) for name, one in told if one is not None]


def _sections(found: _Found) -> Iterator[Section]:
    yield Section(title="What was varied", parts=(Words(text=_NOTE),))
    yield Section(title="Laboratories", parts=(_curves(found), _laboratory_table(found)))
    caption = (
        f"The {len(found.strongest)} numbers of the spec that change the advantage most, at half and one and a half: "
        "ratio of lids and latches, less that of naive observers, with 95 % intervals over paired runs."
    )
    drawn = differences(_numbers(found), "ratio, less naive", caption)
    yield Section(title="Numbers of the spec", parts=(drawn, _number_table(found)))


def _curves(found: _Found) -> Drawing:
    told = [
        Panel(
            title=axis,
            across=_ACROSS[axis],
            nominal=_NOMINAL[axis],
            curves=[
                Curve(
                    name="preconditions less naive",
                    points=[at(value, found.advantage(name)) for value, name in _along(axis)],
                )
            ],
        )
        for axis in _ACROSS
    ]
    caption = "The ratio of lids and latches less that of naive observers. The grey line: the laboratory as it is."
    return panels(told, "ratio, less naive", caption)


def _along(axis: str) -> Sequence[tuple[float, str]]:
    """Return the laboratories of an axis, that of the protocol among them, in order."""
    return sorted([(_NOMINAL[axis], _AS_IT_IS), *((each.value, each.name) for each in VARIATIONS if each.axis == axis)])


_HEADER = ("", "arm", "ratio", "strict ratio", "ratio, less naive", "strict, less naive", "wrong at decisions")


def _laboratory_table(found: _Found) -> Table:
    both = (NAIVE.name, PRECONDITIONS.name)
    rows = [
        (name, *ratios(one), one.answers.wrong)
        for name in found.by_name
        for one in (found.of(name, arm) for arm in both)
        if one is not None
    ]
    return plain_table("Lids and latches in each laboratory, over all runs.", _HEADER, rows)


def _number_table(found: _Found) -> Table:
    rows = [("as it is", *ratios(one), one.answers.wrong) for one in found.by_name[_AS_IT_IS]]
    return plain_table("Lids and latches with other numbers in the spec, over all runs.", _HEADER, rows)


EXPERIMENT = Experiment(
    name="lab-sensitivity",
    question="In which laboratories, and with which numbers in the spec, does the advantage over naive vanish?",
    seeds=4,
    trials=trials,
    judge=judge,
)
