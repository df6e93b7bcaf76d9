"""`lab-transfer`: does a spec hold for a machine that nothing in it was made for?"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from codra_dsl.integrations.inspection import read_spec
from codra_papers.experiments.campaign.cells import interval, plain_table, ratio
from codra_papers.experiments.campaign.document import Document, Section, Table, Words
from codra_papers.experiments.campaign.experiment import Experiment, Settings
from codra_papers.experiments.lab.arms import NAIVE, NAIVE_PACED, NEED, NEED_ON_EVENT, PRECONDITIONS
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.lab.trials import Trial
from codra_papers.experiments.studies.beyond.arm_comparison import (
    Standing,
    reported_seeds,
    runs_sentence,
    standings,
    standings_as_data,
    standings_tables,
)
from codra_papers.experiments.studies.beyond.more_machines import FURTHER, spec_with, use_line
from codra_papers.experiments.studies.beyond.workloads import Tending
from codra_papers.experiments.studies.robustness import drawings
from codra_papers.experiments.studies.robustness.findings import Counted, Runs, paper, strict, vision_algorithms
from codra_papers.experiments.studies.robustness.tables import arms_table
from codra_papers.lab.mission import PCR_CYCLER
from codra_papers.lab.simulator.laboratory import LABORATORY

ARMS = (NAIVE, NAIVE_PACED, PRECONDITIONS, NEED, NEED_ON_EVENT)

THIRD = FURTHER[0]
"""A shaker: wider than the PCR-cycler and narrower than the centrifuge, with six tags of sizes between theirs."""

_WHAT = ("in_observable_distance", "in_manipulation_distance", "base_in_FOV", "lid_in_FOV", "open", "locked")
_MACHINES = (THIRD.name, PCR_CYCLER)


def extended(settings: Settings) -> Path:
    """Write the spec under test with one line more.

    Raises:
        SpecError: if it has errors, or no place for the line.
        OSError: if it cannot be written.
    """
    return spec_with(settings.spec, [THIRD], settings.folder / "spec")


def trials(settings: Settings) -> Sequence[Trial]:
    """Return one run a seed, in a laboratory with a third machine.

    Raises:
        SpecError: if the spec has errors, or no place for the line.
        OSError: if it cannot be written.
    """
    spec = extended(settings)
    return [
        Trial(
            name=f"run-{seed}",
            spec=spec,
            seed=seed,
            arms=ARMS,
            laboratory=LABORATORY.with_machines(THIRD),
            work=Tending(machines=(THIRD.name, PCR_CYCLER, THIRD.name)),
        )
        for seed in reported_seeds(settings)
    ]


def judge(settings: Settings, outcomes: Mapping[str, Outcome]) -> Document:
    """Return the report on the outcomes of `trials`.

    Raises:
        SpecError: if the spec has errors, or no place for the line.
        OSError: if it cannot be written.
    """
    told, vision = list(outcomes.values()), vision_algorithms(read_spec(extended(settings)))
    found = {
        machine: standings(told, (f"{machine}_open", f"{machine}_locked"), NAIVE.name, vision) for machine in _MACHINES
    }
    return Document(
        title="lab-transfer: a third machine by one line",
        summary=(*(line for machine in _MACHINES for line in _summary(machine, found[machine])), runs_sentence(told)),
        sections=tuple(_sections(told, found)),
        results={"line": use_line(THIRD)}
        | {machine: {"lid_and_latch": standings_as_data(found[machine])} for machine in _MACHINES},
    )


def _summary(machine: str, found: Sequence[Standing]) -> Iterator[str]:
    for one in found:
        if one.arm in (PRECONDITIONS.name, NEED.name) and one.paper_difference and one.strict_difference:
            yield (
                f"Lid and latch of the {machine}, {one.arm} less naive: ratio {interval(one.paper_difference)}, strict "
                f"ratio {interval(one.strict_difference)}; {one.answers.wrong} wrong values at decisions."
            )


def _sections(told: Sequence[Outcome], found: Mapping[str, Sequence[Standing]]) -> Iterator[Section]:
    note = (
        f"To the spec under test one line is added: “{use_line(THIRD)}”. No threshold was chosen for the "
        "shaker: what the template does not ask for is its default. The robot tends the shaker, the PCR-cycler and the "
        "shaker again, and looks at each of its decisions by itself."
    )
    yield Section(title="Arms", parts=(Words(text=note), arms_table(ARMS)))
    caption = (
        "Lid and latch of the {}, over all runs. Differences are to naive observers, with 95 % intervals over paired "
        "runs."
    )
    for machine in _MACHINES:
        parts = (*standings_tables(found[machine], caption.format(machine)), _variables(told, machine))
        yield Section(title=f"The {machine}", parts=parts)
    caption = "What was true and what each arm held; red behind what was wrong."
    yield Section(title="One run over time", parts=(drawings.timeline(told[0], f"{THIRD.name}_open", caption),))


def _variables(told: Sequence[Outcome], machine: str) -> Table:
    runs = Runs(told)
    counted: Sequence[tuple[str, Counted]] = (("ratio", paper), ("strict ratio", strict))
    rows = [
        (f"{machine}_{what}", name, *(ratio(how(runs.total(f"{machine}_{what}", arm))) for arm in runs.arms))
        for what in _WHAT
        for name, how in counted
    ]
    return plain_table(f"All variables of the {machine}.", ("variable", "", *runs.arms), rows)


EXPERIMENT = Experiment(
    name="lab-transfer",
    question="Does the spec hold for a machine of another shape that is added by one line?",
    seeds=6,
    trials=trials,
    judge=judge,
)
