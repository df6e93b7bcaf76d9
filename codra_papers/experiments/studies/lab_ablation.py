"""`lab-ablation`: the value of each precondition and each refinement.

The conditions to remove are read from the spec and not listed here, so that added conditions are studied as well.
"""

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
from codra_papers.experiments.lab.spec_variants import WithoutCondition
from codra_papers.experiments.lab.trials import Trial
from codra_papers.experiments.studies.beyond.arm_comparison import (
    IN_VIEW,
    LIDS_AND_LATCHES,
    ArmComparison,
    arm_comparison_tables,
    arm_comparisons,
    arm_comparisons_as_data,
    runs_sentence,
)
from codra_papers.experiments.studies.beyond.workloads import both_and_back
from codra_papers.experiments.studies.robustness.findings import vision_algorithms
from codra_papers.experiments.studies.robustness.tables import arms_table

_LEAST = 0.001
"""The smallest difference of ratios that the summary reports. The tables contain all differences."""

_MACHINES = ("centrifuge", "pcr_cycler")

_NOTE = (
    "Each arm lacks one condition, wherever the spec requires it: one of observable_when (a precondition) or of "
    "accept_when (a refinement). All arms observe everything while the other conditions hold, on the "
    "same frames; naive observers lack all conditions. The main execution tends the centrifuge, the PCR-cycler and the "
    "centrifuge again, which is shorter than a loop: no tray is carried and no rotor is turned."
)


def conditions(spec: Spec) -> Sequence[WithoutCondition]:
    """Return the removable conditions; a condition that algorithms of several machines share is listed once."""
    removable = (
        WithoutCondition(algorithm=_name_end(algorithm), condition=_without_machine(condition.text))
        for algorithm in spec.perception
        for condition in (*algorithm.observable_when, *algorithm.accept_when)
    )
    return tuple(dict.fromkeys(removable))


def _name_end(algorithm: Algorithm) -> str:
    """Return the end of the names of all algorithms that do the same for another machine."""
    for machine in _MACHINES:
        _, separator, end = algorithm.name.partition(machine)
        if separator:
            return end
    return algorithm.name


def _without_machine(text: str) -> str:
    return next((text.removeprefix(machine) for machine in _MACHINES if text.startswith(machine)), text)


def arms(settings: Settings) -> tuple[Arm, ...]:
    """Return the spec with all conditions, without each of them, and without all of them."""
    ablated_arms = (
        PRECONDITIONS.with_edit(f"*{edit.algorithm} without *{edit.condition}", edit)
        for edit in conditions(read_spec(settings.spec))
    )
    return (PRECONDITIONS, *ablated_arms, NAIVE)


def trials(settings: Settings) -> Sequence[Trial]:
    """Return one run per seed, with all arms in it."""
    return both_and_back(settings, arms(settings))


def judge(settings: Settings, outcomes: Mapping[str, Outcome]) -> Document:
    """Return the report on the outcomes of `trials`.

    Raises:
        SpecError: if the spec has errors.
    """
    runs, vision = list(outcomes.values()), vision_algorithms(read_spec(settings.spec))
    lids, views = (arm_comparisons(runs, names, PRECONDITIONS.name, vision) for names in (LIDS_AND_LATCHES, IN_VIEW))
    caption = (
        "{}, over all runs. Differences are to the arm with all conditions, with 95 % intervals over paired runs. "
        "Below zero, the removed condition was useful."
    )
    sections = (
        Section(title="Arms", parts=(Words(text=_NOTE), arms_table(arms(settings)))),
        Section(title="Lids and latches", parts=arm_comparison_tables(lids, caption.format("Lids and latches"))),
        Section(
            title="Bases and lids in view", parts=arm_comparison_tables(views, caption.format("Bases and lids in view"))
        ),
    )
    return Document(
        title="lab-ablation: the value of each condition",
        summary=(*_summary("Lids and latches", lids), *_summary("Bases and lids in view", views), runs_sentence(runs)),
        sections=sections,
        results={"lids_and_latches": arm_comparisons_as_data(lids), "in_view": arm_comparisons_as_data(views)},
    )


def _summary(group: str, comparisons: Sequence[ArmComparison]) -> Iterator[str]:
    """Yield sentences: which conditions certainly help or harm, and for how many conditions the effect is unclear."""
    ablated_comparisons = [
        comparison for comparison in comparisons if comparison.arm not in (PRECONDITIONS.name, NAIVE.name)
    ]
    relevant_comparisons = [
        comparison
        for comparison in ablated_comparisons
        if comparison.paper_difference is not None and _matters(comparison.paper_difference)
    ]
    worse_comparisons = [
        comparison
        for comparison in relevant_comparisons
        if comparison.paper_difference and comparison.paper_difference.is_negative
    ]
    better_comparisons = [
        comparison
        for comparison in relevant_comparisons
        if comparison.paper_difference and comparison.paper_difference.is_positive
    ]
    yield f"{group}: the ratio falls, with the interval below zero, in {_differences_text(worse_comparisons)}."
    yield f"{group}: the ratio rises, with the interval above zero, in {_differences_text(better_comparisons)}."
    unclear_count = len(ablated_comparisons) - len(worse_comparisons) - len(better_comparisons)
    yield (
        f"{group}: for {unclear_count} of {len(ablated_comparisons)} conditions the interval contains zero or is "
        f"missing, or the difference is below {_LEAST}."
    )


def _matters(difference: Estimate) -> bool:
    return difference.value is not None and abs(difference.value) >= _LEAST


def _differences_text(comparisons: Sequence[ArmComparison]) -> str:
    return (
        "; ".join(
            f"{comparison.arm} ({interval(comparison.paper_difference)})"
            for comparison in comparisons
            if comparison.paper_difference
        )
        or "none"
    )


EXPERIMENT = Experiment(
    name="lab-ablation",
    question="What is each precondition and each refinement of the spec worth?",
    seeds=4,
    trials=trials,
    judge=judge,
)
