"""The report on all runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from codra_dsl.integrations.inspection import read_spec
from codra_papers.experiments.campaign.document import Document, Section, Table, Words
from codra_papers.experiments.campaign.experiment import Settings
from codra_papers.experiments.lab.arms import NEED_ON_EVENT
from codra_papers.experiments.lab.glossary import glossary
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.studies.lab_runtime.alternatives import judge_alternatives
from codra_papers.experiments.studies.lab_runtime.day import judge_day
from codra_papers.experiments.studies.lab_runtime.finding import rounded
from codra_papers.experiments.studies.lab_runtime.paper import EXECUTION_COUNT
from codra_papers.experiments.studies.lab_runtime.rings import judge_rings
from codra_papers.experiments.studies.lab_runtime.runs import DECISION_S, alternatives_day, day_pair, tending_pairs
from codra_papers.experiments.studies.lab_runtime.sources import judge_sources
from codra_papers.experiments.studies.lab_runtime.tending import judge_tending
from codra_papers.experiments.studies.lab_runtime.wrong import judge_wrong
from codra_papers.lab.mission import WAIT_S


def judge(settings: Settings, outcomes: Mapping[str, Outcome]) -> Document:
    """Return the report on all runs.

    Raises:
        SpecError: if the spec has errors.
    """
    pairs = tending_pairs(settings, outcomes)
    day, runs = day_pair(outcomes), list(outcomes.values())
    findings = [
        judge_tending(pairs),
        judge_sources(pairs),
        judge_day(day),
        judge_rings(day.observed),
        judge_alternatives(read_spec(settings.spec), day.observed, alternatives_day(outcomes)),
        judge_wrong(runs, settings.folder),
    ]
    sections = [_protocol_section(settings), *(finding.section for finding in findings), _early_ends_section(runs)]
    return Document(
        title="lab-runtime: reduced runtime through observers",
        summary=[sentence for finding in findings for sentence in finding.summary],
        sections=[glossary(sections), *sections],
        results={
            "decision_s": DECISION_S,
            "wait_up_to_s": WAIT_S,
            "ended_early": {outcome.name: outcome.error for outcome in runs if outcome.error is not None},
            **{name: value for finding in findings for name, value in finding.results.items()},
        },
    )


def _protocol_section(settings: Settings) -> Section:
    return Section(
        title="Runs",
        parts=[
            Words(
                text="The robot drives to the PCR-cycler, unlocks and opens it, and closes and locks it,"
                f" {EXECUTION_COUNT} times, on a first seed as in P1 and on {settings.seeds} further seeds. Without"
                " observers it looks for each decision. With observers it asks the observers of the arm"
                f" '{NEED_ON_EVENT.name}', and looks if they have no answer. Two runs with the same seed have the same"
                " world, and the same durations and slips of the robot's actions."
            ),
            Words(
                text=f"Each request to the observers takes {DECISION_S:g} s, which is more than 99 of 100 measured"
                " requests took (docs/papers/lab-runtime.md)."
                f" After an action the robot waits up to {WAIT_S:g} s for the observers before it looks. Perception"
                " time includes these requests and waits. Jobs of observers take as long as the robot's own"
                " processing, and share one vision slot with this processing."
            ),
        ],
    )


def _early_ends_section(outcomes: Sequence[Outcome]) -> Section:
    rows = [
        (outcome.name, rounded(outcome.duration_s, 1), outcome.error)
        for outcome in outcomes
        if outcome.error is not None
    ]
    return Section(
        title="Runs that ended early",
        parts=[
            Table(
                caption="Unrecoverable errors. Executions that such an error interrupted are left out.",
                header=("run", "at s", "error"),
                rows=rows,
            )
        ],
    )
