"""`lab-budgets`: how much knowledge does each arm keep if more and more machines share one vision slot?"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from codra_dsl.integrations.inspection import read_spec
from codra_papers.experiments.campaign.cells import interval
from codra_papers.experiments.campaign.document import Document, Drawing, Section, Words
from codra_papers.experiments.campaign.experiment import Experiment, Settings
from codra_papers.experiments.lab.algorithms import vision_algorithms
from codra_papers.experiments.lab.arms import NAIVE, NEED, PRECONDITIONS
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.lab.trials import Trial
from codra_papers.experiments.studies.beyond.arm_comparison import (
    LIDS_AND_LATCHES,
    VIEW_VARIABLES,
    ArmComparison,
    arm_comparison_tables,
    arm_comparisons,
    arm_comparisons_as_data,
    reported_seeds,
    runs_sentence,
)
from codra_papers.experiments.studies.beyond.curves import Curve, Point, curves
from codra_papers.experiments.studies.beyond.more_machines import FURTHER_MACHINES, spec_with, use_line
from codra_papers.experiments.studies.beyond.workloads import Tending
from codra_papers.experiments.studies.robustness.tables import arms_table
from codra_papers.lab.mission import CENTRIFUGE, PCR_CYCLER
from codra_papers.lab.simulator.laboratory import LABORATORY

ARMS = (NAIVE, PRECONDITIONS, NEED)

MACHINE_COUNTS = (2, 4, 8)
"""The numbers of machines. The protocol has two machines."""

_NOTE = (
    "Two machines are those of the protocol. The others are in free places of the same room; each of them is added to "
    "the spec by one line under 'use'. The robot always tends the PCR-cycler and the centrifuge, and looks by itself "
    "for each of its decisions. All observers of an arm share the one vision slot of the arm."
)


def trials(settings: Settings) -> Sequence[Trial]:
    """Return one run for each number of machines and each seed.

    Raises:
        SpecError: if the spec has errors, or no block of lines under `use`.
        OSError: if a spec cannot be written.
    """
    return [
        Trial(
            name=f"machines-{count}-run-{seed}",
            spec=spec_with(settings.spec, FURTHER_MACHINES[: count - 2], settings.folder / "specs" / str(count)),
            seed=seed,
            arms=ARMS,
            laboratory=LABORATORY.with_machines(*FURTHER_MACHINES[: count - 2]),
            work=Tending(machines=(PCR_CYCLER, CENTRIFUGE)),
        )
        for count in MACHINE_COUNTS
        for seed in reported_seeds(settings)
    ]


def judge(settings: Settings, outcomes: Mapping[str, Outcome]) -> Document:
    """Return the report on the outcomes of `trials`.

    Raises:
        SpecError: if the spec has errors, or no block of lines under `use`.
        OSError: if a spec cannot be written.
    """
    slot_algorithms = {trial.name: vision_algorithms(read_spec(trial.spec)) for trial in trials(settings)}
    outcomes_by_count = {
        count: [outcome for name, outcome in outcomes.items() if name.startswith(f"machines-{count}-")]
        for count in MACHINE_COUNTS
    }
    lid_comparisons, view_comparisons = (
        {
            count: arm_comparisons(runs, names, NAIVE.name, slot_algorithms[runs[0].name])
            for count, runs in outcomes_by_count.items()
        }
        for names in (LIDS_AND_LATCHES, VIEW_VARIABLES)
    )
    return Document(
        title="lab-budgets: more machines, one vision slot",
        summary=(*_summary(lid_comparisons), runs_sentence(list(outcomes.values()))),
        sections=tuple(_sections(lid_comparisons, view_comparisons)),
        results={
            "lines": [use_line(machine) for machine in FURTHER_MACHINES],
            "lids_and_latches": {
                str(count): arm_comparisons_as_data(comparisons) for count, comparisons in lid_comparisons.items()
            },
            "in_view": {
                str(count): arm_comparisons_as_data(comparisons) for count, comparisons in view_comparisons.items()
            },
        },
    )


_ComparisonsByCount = Mapping[int, Sequence[ArmComparison]]


def _summary(lid_comparisons: _ComparisonsByCount) -> Iterator[str]:
    for count, comparisons in lid_comparisons.items():
        for comparison in comparisons:
            if comparison.paper_difference is not None and comparison.strict_difference is not None:
                lag_s = comparison.lags.quantile_s(0.5)
                naive_lag_s = comparisons[0].lags.quantile_s(0.5)
                yield (
                    f"With {count} machines, {comparison.arm} minus naive: ratio "
                    f"{interval(comparison.paper_difference)}, strict ratio {interval(comparison.strict_difference)}; "
                    f"median lag {_seconds_text(lag_s)} (naive {_seconds_text(naive_lag_s)})."
                )


def _seconds_text(lag_s: float | None) -> str:
    return "none" if lag_s is None else f"{lag_s:.1f} s"


def _sections(lid_comparisons: _ComparisonsByCount, view_comparisons: _ComparisonsByCount) -> Iterator[Section]:
    use_lines = Words(text="The lines, in order: " + "; ".join(use_line(machine) for machine in FURTHER_MACHINES) + ".")
    yield Section(title="Arms", parts=(Words(text=_NOTE), use_lines, arms_table(ARMS)))
    yield Section(title="Over the number of machines", parts=(_strict_ratio_drawing(lid_comparisons),))
    caption = (
        "{}, {} machines, over all runs. Differences are relative to naive observers, with 95 % intervals over paired "
        "runs."
    )
    for count in lid_comparisons:
        parts = (
            *arm_comparison_tables(
                lid_comparisons[count], caption.format("Lids and latches of the two tended machines", count)
            ),
            *arm_comparison_tables(
                view_comparisons[count],
                caption.format("Bases and lids of the two tended machines in view", count),
            ),
        )
        yield Section(title=f"{count} machines", parts=parts)


def _strict_ratio_drawing(lid_comparisons: _ComparisonsByCount) -> Drawing:
    strict_ratios = [
        Curve(
            name=arm.name,
            points=tuple(
                Point(x=count, y=_comparison_of(comparisons, arm.name).strict_ratio)
                for count, comparisons in lid_comparisons.items()
            ),
        )
        for arm in ARMS
    ]
    caption = (
        "Strict ratio of lids and latches of the two tended machines: the seconds with a right value as a share of all "
        "seconds."
    )
    return curves(strict_ratios, "machines that share one vision slot", "strict ratio", caption)


def _comparison_of(comparisons: Sequence[ArmComparison], arm: str) -> ArmComparison:
    return next(comparison for comparison in comparisons if comparison.arm == arm)


EXPERIMENT = Experiment(
    name="lab-budgets",
    question="What is left of each arm's knowledge when two, four and eight machines share one vision slot?",
    seeds=4,
    trials=trials,
    judge=judge,
)
