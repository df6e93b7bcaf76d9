"""`lab-options`: the effects of validity, changes, confirmation and `refresh: on_event`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from codra_dsl.integrations.inspection import read_spec
from codra_dsl.language.model import Refresh
from codra_papers.experiments.campaign.cells import interval
from codra_papers.experiments.campaign.document import Document, Section, Words
from codra_papers.experiments.campaign.experiment import Experiment, Settings
from codra_papers.experiments.lab.algorithms import vision_algorithms
from codra_papers.experiments.lab.arms import NAIVE, NEED_ON_EVENT, Arm
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.lab.spec_variants import (
    SpecEdit,
    WithConfirmation,
    WithoutChanges,
    WithoutValidity,
    WithRefresh,
)
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

UNCHANGED_ARM = replace(NEED_ON_EVENT, name="as it stands")
"""The arm with the options of the spec."""

_JUDGED_SUFFIXES = ("_open", "_locked")

OPTIONS: Mapping[str, SpecEdit] = {
    "without validity": WithoutValidity(),
    "without changes": WithoutChanges(),
    "without confirmation": WithConfirmation(needed_results=1, compared_results=1, variables=_JUDGED_SUFFIXES),
    "confirmed, 2 of 2": WithConfirmation(needed_results=2, compared_results=2, variables=_JUDGED_SUFFIXES),
    "confirmed, 2 of 3": WithConfirmation(needed_results=2, compared_results=3, variables=_JUDGED_SUFFIXES),
    "periodic": WithRefresh(refresh=Refresh.PERIODIC),
    "on event": WithRefresh(refresh=Refresh.ON_EVENT),
}
"""The options. An arm changes one option: it switches the option on if it is off in the spec, and off if it is on."""

_NOTE = (
    "Each arm changes one option of the spec and nothing else; an option that would not change the spec is left "
    "out. All arms see the same frames, and look only while a skill needs the variable. The main execution looks by "
    "itself for each of its decisions. It tends the centrifuge, the PCR-cycler and the centrifuge again. This takes "
    "less time than a loop, because no tray is carried and no rotor is turned."
)


def arms(settings: Settings) -> tuple[Arm, ...]:
    """Return the arm with the unchanged spec, an arm for each option that changes the spec, and naive observers."""
    spec = read_spec(settings.spec)
    changed_arms = [UNCHANGED_ARM.with_edit(name, edit) for name, edit in OPTIONS.items() if edit(spec) != spec]
    return (UNCHANGED_ARM, *changed_arms, NAIVE)


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
        arm_comparisons(runs, names, UNCHANGED_ARM.name, slot_algorithms)
        for names in (LIDS_AND_LATCHES, VIEW_VARIABLES)
    )
    caption = "{}, over all runs. Differences are relative to the unchanged spec, with 95 % intervals over paired runs."
    return Document(
        title="lab-options: the effect of each option",
        summary=(*_summary(lid_comparisons), runs_sentence(runs)),
        sections=(
            Section(title="Arms", parts=(Words(text=_NOTE), arms_table(arms(settings)))),
            Section(
                title="Lids and latches",
                parts=arm_comparison_tables(lid_comparisons, caption.format("Lids and latches of both machines")),
            ),
            Section(
                title="Bases and lids in view",
                parts=arm_comparison_tables(view_comparisons, caption.format("Bases and lids in view")),
            ),
        ),
        results={
            "lids_and_latches": arm_comparisons_as_data(lid_comparisons),
            "in_view": arm_comparisons_as_data(view_comparisons),
        },
    )


def _summary(comparisons: Sequence[ArmComparison]) -> Iterator[str]:
    unchanged_comparison = comparisons[0]
    for comparison in comparisons[1:]:
        if comparison.paper_difference is None or comparison.strict_difference is None:
            continue
        triggers_text = (
            "no triggers to compare"
            if not unchanged_comparison.triggers
            else f"{comparison.triggers / unchanged_comparison.triggers:.2f} times the triggers"
        )
        yield (
            f"{comparison.arm}: ratio {interval(comparison.paper_difference)}, strict ratio "
            f"{interval(comparison.strict_difference)} against the unchanged spec; {triggers_text}, "
            f"{comparison.answers.wrong} wrong values at decisions (unchanged: {unchanged_comparison.answers.wrong})."
        )


EXPERIMENT = Experiment(
    name="lab-options",
    question="Which effects do validity, changes, confirmation and refresh on_event have on what is known?",
    seeds=6,
    trials=trials,
    judge=judge,
)
