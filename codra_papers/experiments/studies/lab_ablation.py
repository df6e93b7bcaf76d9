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
from codra_papers.experiments.lab.algorithms import vision_algorithms
from codra_papers.experiments.lab.arms import NAIVE, PRECONDITIONS, Arm
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.lab.spec_variants import WithoutAlternatives, WithoutCondition
from codra_papers.experiments.lab.trials import Trial
from codra_papers.experiments.studies.beyond.arm_comparison import (
    LIDS_AND_LATCHES,
    VIEW_VARIABLES,
    ArmComparison,
    arm_comparison_tables,
    arm_comparisons,
    arm_comparisons_as_data,
    runs_sentence,
)
from codra_papers.experiments.studies.beyond.workloads import return_visit_trials
from codra_papers.experiments.studies.robustness.tables import arms_table

_LEAST_DIFFERENCE = 0.001
"""The smallest difference of ratios that the summary reports. The tables contain all differences."""

_MACHINES = ("centrifuge", "pcr_cycler")

_NOTE = (
    "In each arm, one condition is removed wherever the spec requires it: a precondition (in observable_when) or a "
    "refinement (in accept_when). All arms see the same frames, and observe everything while the other conditions "
    "hold. Naive observers have no conditions. The main execution tends the centrifuge, the PCR-cycler and the "
    "centrifuge again. This takes less time than a loop, because no tray is carried and no rotor is turned."
)


def condition_removals(spec: Spec) -> Sequence[WithoutCondition]:
    """Return an edit for each condition. A condition that algorithms of several machines share has one edit."""
    removals = (
        WithoutCondition(algorithm=_name_end(algorithm), condition=_text_without_machine(condition.text))
        for algorithm in spec.perception
        for condition in (*algorithm.observable_when, *algorithm.accept_when)
    )
    return tuple(dict.fromkeys(removals))


def _name_end(algorithm: Algorithm) -> str:
    """Return the suffix that the algorithm's name shares with the algorithms that do the same for other machines."""
    for machine in _MACHINES:
        _, separator, end = algorithm.name.partition(machine)
        if separator:
            return end
    return algorithm.name


def _text_without_machine(text: str) -> str:
    return next((text.removeprefix(machine) for machine in _MACHINES if text.startswith(machine)), text)


def arms(settings: Settings) -> tuple[Arm, ...]:
    """Return the arm with all conditions, an arm without each single condition, and the arm without any condition."""
    ablated_arms = (
        PRECONDITIONS.with_edit(f"*{edit.algorithm} without *{edit.condition}", edit)
        for edit in condition_removals(WithoutAlternatives()(read_spec(settings.spec)))
    )
    return (PRECONDITIONS, *ablated_arms, NAIVE)


def trials(settings: Settings) -> Sequence[Trial]:
    """Return one run per seed. Each run has all arms."""
    return return_visit_trials(settings, arms(settings))


def judge(settings: Settings, outcomes: Mapping[str, Outcome]) -> Document:
    """Return the report on the outcomes of `trials`.

    Raises:
        SpecError: if the spec has errors.
    """
    runs, slot_algorithms = list(outcomes.values()), vision_algorithms(read_spec(settings.spec))
    lid_comparisons, view_comparisons = (
        arm_comparisons(runs, names, PRECONDITIONS.name, slot_algorithms)
        for names in (LIDS_AND_LATCHES, VIEW_VARIABLES)
    )
    caption = (
        "{}, over all runs. Differences are relative to the arm with all conditions, with 95 % intervals over paired "
        "runs. If a difference is below zero, the removed condition was useful."
    )
    sections = (
        Section(title="Arms", parts=(Words(text=_NOTE), arms_table(arms(settings)))),
        Section(
            title="Lids and latches", parts=arm_comparison_tables(lid_comparisons, caption.format("Lids and latches"))
        ),
        Section(
            title="Bases and lids in view",
            parts=arm_comparison_tables(view_comparisons, caption.format("Bases and lids in view")),
        ),
    )
    return Document(
        title="lab-ablation: the value of each condition",
        summary=(
            *_summary("Lids and latches", lid_comparisons),
            *_summary("Bases and lids in view", view_comparisons),
            runs_sentence(runs),
        ),
        sections=sections,
        results={
            "lids_and_latches": arm_comparisons_as_data(lid_comparisons),
            "in_view": arm_comparisons_as_data(view_comparisons),
        },
    )


def _summary(group: str, comparisons: Sequence[ArmComparison]) -> Iterator[str]:
    """Yield sentences on the conditions that certainly help or harm, and on how many have an unclear effect."""
    ablated_comparisons = [
        comparison for comparison in comparisons if comparison.arm not in (PRECONDITIONS.name, NAIVE.name)
    ]
    relevant_comparisons = [
        comparison
        for comparison in ablated_comparisons
        if comparison.paper_difference is not None and _is_relevant(comparison.paper_difference)
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
    yield f"{group}: arms with a lower ratio and an interval below zero: {_differences_text(worse_comparisons)}."
    yield f"{group}: arms with a higher ratio and an interval above zero: {_differences_text(better_comparisons)}."
    unclear_count = len(ablated_comparisons) - len(worse_comparisons) - len(better_comparisons)
    yield (
        f"{group}: for {unclear_count} of {len(ablated_comparisons)} conditions the interval contains zero or is "
        f"missing, or the difference is below {_LEAST_DIFFERENCE}."
    )


def _is_relevant(difference: Estimate) -> bool:
    return difference.value is not None and abs(difference.value) >= _LEAST_DIFFERENCE


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
