"""`lab-transfer`: does a spec work for a machine for which it was not made?"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from codra_dsl.integrations.inspection import read_spec
from codra_papers.experiments.campaign.cells import interval, plain_table, rounded
from codra_papers.experiments.campaign.document import Document, Section, Table, Words
from codra_papers.experiments.campaign.experiment import Experiment, Settings
from codra_papers.experiments.lab.algorithms import vision_algorithms
from codra_papers.experiments.lab.arms import NAIVE, NAIVE_PACED, NEED, NEED_ON_EVENT, PRECONDITIONS
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.lab.trials import Trial
from codra_papers.experiments.studies.beyond.arm_comparison import (
    ArmComparison,
    arm_comparison_tables,
    arm_comparisons,
    arm_comparisons_as_data,
    reported_seeds,
    runs_sentence,
)
from codra_papers.experiments.studies.beyond.more_machines import FURTHER_MACHINES, spec_with, use_line
from codra_papers.experiments.studies.beyond.workloads import Tending
from codra_papers.experiments.studies.robustness import drawings
from codra_papers.experiments.studies.robustness.findings import MEASURES, MEASURES_NOTE, Runs
from codra_papers.experiments.studies.robustness.tables import arms_table
from codra_papers.lab.mission import PCR_CYCLER
from codra_papers.lab.simulator.laboratory import LABORATORY

ARMS = (NAIVE, NAIVE_PACED, PRECONDITIONS, NEED, NEED_ON_EVENT)

THIRD_MACHINE = FURTHER_MACHINES[0]
"""A shaker: its width and the sizes of its six tags are between those of the PCR-cycler and the centrifuge."""

_VARIABLE_SUFFIXES = (
    "in_observable_distance",
    "in_manipulation_distance",
    "base_in_FOV",
    "lid_in_FOV",
    "open",
    "locked",
)
_MACHINES = (THIRD_MACHINE.name, PCR_CYCLER)


def write_extended_spec(settings: Settings) -> Path:
    """Write the spec under test with one additional line, and return the path of the new spec.

    Raises:
        SpecError: if the spec has errors, or no block of lines under `use`.
        OSError: if a file cannot be written.
    """
    return spec_with(settings.spec, [THIRD_MACHINE], settings.folder / "spec")


def trials(settings: Settings) -> Sequence[Trial]:
    """Return one run per seed, in a laboratory with a third machine.

    Raises:
        SpecError: if the spec has errors, or no block of lines under `use`.
        OSError: if a file cannot be written.
    """
    spec = write_extended_spec(settings)
    return [
        Trial(
            name=f"run-{seed}",
            spec=spec,
            seed=seed,
            arms=ARMS,
            laboratory=LABORATORY.with_machines(THIRD_MACHINE),
            work=Tending(machines=(THIRD_MACHINE.name, PCR_CYCLER, THIRD_MACHINE.name)),
        )
        for seed in reported_seeds(settings)
    ]


def judge(settings: Settings, outcomes: Mapping[str, Outcome]) -> Document:
    """Return the report on the outcomes of `trials`.

    Raises:
        SpecError: if the spec has errors, or no block of lines under `use`.
        OSError: if a file cannot be written.
    """
    runs, slot_algorithms = list(outcomes.values()), vision_algorithms(read_spec(write_extended_spec(settings)))
    comparisons = {
        machine: arm_comparisons(runs, (f"{machine}_open", f"{machine}_locked"), NAIVE.name, slot_algorithms)
        for machine in _MACHINES
    }
    return Document(
        title="lab-transfer: a third machine by one line",
        summary=(
            *(line for machine in _MACHINES for line in _summary(machine, comparisons[machine])),
            runs_sentence(runs),
        ),
        sections=tuple(_sections(runs, comparisons)),
        results={"line": use_line(THIRD_MACHINE)}
        | {machine: {"lid_and_latch": arm_comparisons_as_data(comparisons[machine])} for machine in _MACHINES},
    )


def _summary(machine: str, comparisons: Sequence[ArmComparison]) -> Iterator[str]:
    for comparison in comparisons:
        if (
            comparison.arm in (PRECONDITIONS.name, NEED.name)
            and comparison.paper_difference
            and comparison.strict_difference
        ):
            yield (
                f"Lid and latch of the {machine}, {comparison.arm} minus naive: ratio "
                f"{interval(comparison.paper_difference)}, strict ratio {interval(comparison.strict_difference)}; "
                f"{comparison.answers.wrong} wrong values at decisions."
            )


def _sections(outcomes: Sequence[Outcome], comparisons: Mapping[str, Sequence[ArmComparison]]) -> Iterator[Section]:
    note = (
        f"One line is added to the spec under test: “{use_line(THIRD_MACHINE)}”. No threshold was chosen for the "
        "shaker: parameters of the template have their defaults. The robot tends the shaker, the PCR-cycler and the "
        "shaker again, and looks by itself for each of its decisions."
    )
    yield Section(title="Arms", parts=(Words(text=note), arms_table(ARMS)))
    caption = (
        "Lid and latch of the {}, over all runs. Differences are relative to naive observers, with 95 % intervals over "
        "paired runs."
    )
    for machine in _MACHINES:
        parts = (*arm_comparison_tables(comparisons[machine], caption.format(machine)), _variables(outcomes, machine))
        yield Section(title=f"The {machine}", parts=parts)
    caption = "The true value and the value that each arm held. The background is coloured while the value is wrong."
    yield Section(
        title="One run over time", parts=(drawings.timeline(outcomes[0], f"{THIRD_MACHINE.name}_open", caption),)
    )


def _variables(outcomes: Sequence[Outcome], machine: str) -> Table:
    runs = Runs(outcomes)
    rows = [
        (
            f"{machine}_{suffix}",
            name,
            *(rounded(measure(runs.total_by_truth(f"{machine}_{suffix}", arm)), 3) for arm in runs.arms),
        )
        for suffix in _VARIABLE_SUFFIXES
        for name, measure in MEASURES.items()
    ]
    caption = f"All variables of the {machine}. {MEASURES_NOTE}"
    return plain_table(caption, ("variable", "", *runs.arms), rows)


EXPERIMENT = Experiment(
    name="lab-transfer",
    question="Does the spec work for a machine of another shape that is added by one line?",
    seeds=6,
    trials=trials,
    judge=judge,
)
