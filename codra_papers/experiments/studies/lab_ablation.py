"""`lab-ablation`: what is each precondition and each refinement worth?"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from codra_dsl.integrations.inspection import read_spec
from codra_dsl.language.model import Algorithm, Spec
from codra_papers.experiments.campaign.cells import interval
from codra_papers.experiments.campaign.document import Document, Section, Words
from codra_papers.experiments.campaign.experiment import Experiment, Settings
from codra_papers.experiments.campaign.statistics import Estimate
from codra_papers.experiments.lab.arms import NAIVE, PRECONDITIONS, Arm
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.lab.spec_variants import Without
from codra_papers.experiments.lab.trials import Trial
from codra_papers.experiments.studies.beyond.arm_comparison import (
    IN_VIEW,
    LIDS_AND_LATCHES,
    Standing,
    runs_sentence,
    standings,
    standings_as_data,
    standings_tables,
)
from codra_papers.experiments.studies.beyond.workloads import both_and_back
from codra_papers.experiments.studies.robustness.findings import vision_algorithms
from codra_papers.experiments.studies.robustness.tables import arms_table

_LEAST = 0.001
"""The least difference of ratios that a summary tells; tables tell all."""

_MACHINES = ("centrifuge", "pcr_cycler")

_NOTE = (
    "Each arm lacks one condition, wherever the spec asks for it: of observable_when (a precondition) or of "
    "accept_when (a refinement). All of them observe everything all the time that the other conditions hold, on the "
    "same frames; naive observers lack all conditions. The main execution tends the centrifuge, the PCR-cycler and the "
    "centrifuge again, which is shorter than a loop: no tray is carried and no rotor turned."
)


def conditions(spec: Spec) -> Sequence[Without]:
    """Return what can be taken away: each condition of algorithms that are alike once, whatever their machine."""
    found = (
        Without(algorithm=_alike(algorithm), condition=_without_machine(condition.text))
        for algorithm in spec.perception
        for condition in (*algorithm.observable_when, *algorithm.accept_when)
    )
    return tuple(dict.fromkeys(found))


def _alike(algorithm: Algorithm) -> str:
    """Return the end of the names of all algorithms that do the same with another machine."""
    for machine in _MACHINES:
        _, found, end = algorithm.name.partition(machine)
        if found:
            return end
    return algorithm.name


def _without_machine(text: str) -> str:
    return next((text.removeprefix(machine) for machine in _MACHINES if text.startswith(machine)), text)


def arms(settings: Settings) -> tuple[Arm, ...]:
    """Return the spec with all conditions, without each of them, and without any."""
    removed = (
        PRECONDITIONS.edited(f"*{edit.algorithm} without *{edit.condition}", edit)
        for edit in conditions(read_spec(settings.spec))
    )
    return (PRECONDITIONS, *removed, NAIVE)


def trials(settings: Settings) -> Sequence[Trial]:
    """Return one run a seed, with all arms in it."""
    return both_and_back(settings, arms(settings))


def judge(settings: Settings, outcomes: Mapping[str, Outcome]) -> Document:
    """Return the report on the outcomes of `trials`.

    Raises:
        SpecError: if the spec has errors.
    """
    told, vision = list(outcomes.values()), vision_algorithms(read_spec(settings.spec))
    lids, views = (standings(told, names, PRECONDITIONS.name, vision) for names in (LIDS_AND_LATCHES, IN_VIEW))
    caption = (
        "{}, over all runs. Differences are to all conditions, with 95 % intervals over paired runs: below zero, the "
        "condition that was taken away was worth something."
    )
    sections = (
        Section(title="Arms", parts=(Words(text=_NOTE), arms_table(arms(settings)))),
        Section(title="Lids and latches", parts=standings_tables(lids, caption.format("Lids and latches"))),
        Section(title="What is in view", parts=standings_tables(views, caption.format("Bases and lids in view"))),
    )
    return Document(
        title="lab-ablation: what each condition is worth",
        summary=(*_summary("Lids and latches", lids), *_summary("What is in view", views), runs_sentence(told)),
        sections=sections,
        results={"lids_and_latches": standings_as_data(lids), "in_view": standings_as_data(views)},
    )


def _summary(what: str, found: Sequence[Standing]) -> Iterator[str]:
    """Say which conditions are worth something for sure, which cost something, and of which nothing can be said."""
    ablated = [one for one in found if one.arm not in (PRECONDITIONS.name, NAIVE.name)]
    told = [one for one in ablated if one.paper_difference is not None and _matters(one.paper_difference)]
    missed = [one for one in told if one.paper_difference and one.paper_difference.is_negative]
    better = [one for one in told if one.paper_difference and one.paper_difference.is_positive]
    yield f"{what}: the ratio falls, the whole interval below zero, in {_told(missed)}."
    yield f"{what}: the ratio rises, the whole interval above zero, in {_told(better)}."
    unsure = len(ablated) - len(missed) - len(better)
    yield (
        f"{what}: for {unsure} of {len(ablated)} conditions the interval holds zero, there is none, "
        f"or the difference is below {_LEAST}."
    )


def _matters(difference: Estimate) -> bool:
    return difference.value is not None and abs(difference.value) >= _LEAST


def _told(found: Sequence[Standing]) -> str:
    return "; ".join(f"{one.arm} ({interval(one.paper_difference)})" for one in found if one.paper_difference) or "none"


EXPERIMENT = Experiment(
    name="lab-ablation",
    question="What is each precondition and each refinement of the spec worth?",
    seeds=4,
    trials=trials,
    judge=judge,
)
