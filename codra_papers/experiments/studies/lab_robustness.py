"""`lab-robustness`: does context make observers more stable, and what does it save (P1, section 4.1)?

Runs store frames together with the poses that the robot believed. For the report, tags are detected in these frames
again with the spec's functions and without a simulator. So reported detections can be verified.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from codra_dsl.integrations.inspection import read_spec
from codra_papers.experiments.campaign.document import Document, Drawing, Section, Words
from codra_papers.experiments.campaign.experiment import FIRST_REPORTED_SEED, Experiment, Settings
from codra_papers.experiments.campaign.seeds import reported_seeds
from codra_papers.experiments.lab.algorithms import vision_algorithms
from codra_papers.experiments.lab.arms import NAIVE, NAIVE_PACED, NEED, NEED_ON_EVENT, PRECONDITIONS
from codra_papers.experiments.lab.glossary import glossary
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.lab.run import OneLoop, Work
from codra_papers.experiments.lab.trials import Trial
from codra_papers.experiments.studies.factors.design import SEEDS_PER_CELL, Lid, factorial_trials, is_factorial
from codra_papers.experiments.studies.factors.report import factorial_report
from codra_papers.experiments.studies.robustness import drawings, results, summary, tables
from codra_papers.experiments.studies.robustness.findings import (
    LIDS,
    VARIABLES,
    Comparison,
    Runs,
    compare,
    label,
)
from codra_papers.experiments.studies.robustness.frames import RepeatedDetection, detect_again
from codra_papers.experiments.studies.robustness.mistakes import Mistake, mistakes, mistakes_table, photographs

ARMS = (NAIVE, NAIVE_PACED, PRECONDITIONS, NEED, NEED_ON_EVENT)

FURTHER_ARMS = tuple(arm for arm in ARMS if arm is not NAIVE_PACED)
"""The arms of the runs for intervals. Only the runs of the tables have the naive arm with P1's pace."""

TABLE_RUN_COUNT = 10
"""The number of runs in the tables, as in P1's Table 2."""

QUICK_TABLE_RUN_COUNT = 1
"""The number of runs in the tables of a quick report."""

FIRST_FURTHER_SEED = FIRST_REPORTED_SEED + TABLE_RUN_COUNT
"""The first seed of the runs for intervals; none of these runs is in a table."""

FRAMES_PER_RUN = 25
"""The number of frames of each run in the tables in which tags are detected again."""

COMPARED_ARMS = (
    *((arm.name, NAIVE.name) for arm in FURTHER_ARMS if arm is not NAIVE),
    (NEED.name, PRECONDITIONS.name),
    (NEED_ON_EVENT.name, NEED.name),
)
"""The pairs of arms with reported differences. The value of the second arm is subtracted from that of the first."""

_NOTE = (
    "All arms watch the same frames of a run, each with a vision slot of its own. If several arms start the same work "
    "at the same instant, it takes the same time in each of them. The main execution looks by itself for each of its "
    "decisions and uses none of the arms, so a run does not depend on any arm. Right, wrong and unknown seconds add up "
    "to the duration of the run. Ratios over runs are ratios of sums, as in P1's Total."
)


def trials(settings: Settings) -> Sequence[Trial]:
    """Return the runs of the tables, the further runs, and the runs of the factorial design.

    A quick report has no factorial design: the runs of `lab-sensitivity` are shorter, and its quick report has one.
    """
    table_run_count = QUICK_TABLE_RUN_COUNT if settings.is_quick else TABLE_RUN_COUNT
    seeds = (
        *range(FIRST_REPORTED_SEED, FIRST_REPORTED_SEED + table_run_count),
        *range(FIRST_FURTHER_SEED, FIRST_FURTHER_SEED + settings.seeds),
    )
    runs = [
        Trial(
            name=f"run-{seed}",
            spec=settings.spec,
            seed=seed,
            arms=ARMS if seed < FIRST_FURTHER_SEED else FURTHER_ARMS,
            frames_kept=FRAMES_PER_RUN if seed < FIRST_FURTHER_SEED else 0,
        )
        for seed in seeds
    ]
    cell_seed_count = 0 if settings.is_quick else min(settings.seeds, SEEDS_PER_CELL)
    factorial_seeds = reported_seeds(EXPERIMENT.name, cell_seed_count)
    return [*runs, *factorial_trials(settings.spec, factorial_seeds, _loop)]


def _loop(lid: Lid) -> Work:
    return OneLoop(leaves_lid_open=lid is Lid.OPEN)


def judge(settings: Settings, outcomes: Mapping[str, Outcome]) -> Document:
    """Return the report on the outcomes of `trials`.

    Raises:
        SpecError: if the spec has errors.
    """
    factorial_outcomes = {name: outcome for name, outcome in outcomes.items() if is_factorial(name)}
    findings = _findings(
        settings, {name: outcome for name, outcome in outcomes.items() if name not in factorial_outcomes}
    )
    factorial = factorial_report(factorial_outcomes, findings.slot_algorithms)
    sections = (*_sections(settings, findings), factorial.section)
    return Document(
        title="lab-robustness: observer stability through context",
        summary=(*_summary(findings), *factorial.summary),
        sections=(glossary(sections), *sections),
        results={**_results(findings), "factors": factorial.results},
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Findings:
    """The content of the report.

    Attributes:
        runs: the runs of the tables.
        further_runs: the runs of the intervals.
        slot_algorithms: the algorithms that need the vision slot.
        wrong_values: wrong values at decisions, in the runs of the tables.
    """

    runs: Runs
    further_runs: Runs
    slot_algorithms: Sequence[str]
    comparisons: Sequence[Comparison]
    wrong_values: Sequence[Mistake]
    repeated_detections: Sequence[RepeatedDetection]


def _findings(settings: Settings, outcomes: Mapping[str, Outcome]) -> _Findings:
    spec = read_spec(settings.spec)
    runs = Runs([outcome for outcome in outcomes.values() if outcome.seed < FIRST_FURTHER_SEED])
    further_runs = Runs([outcome for outcome in outcomes.values() if outcome.seed >= FIRST_FURTHER_SEED])
    return _Findings(
        runs=runs,
        further_runs=further_runs,
        slot_algorithms=vision_algorithms(spec),
        comparisons=[
            compare(further_runs, name, arm, other_arm) for name in VARIABLES for arm, other_arm in COMPARED_ARMS
        ],
        wrong_values=mistakes(runs),
        repeated_detections=detect_again(spec, runs.outcomes, settings.folder),
    )


def _summary(findings: _Findings) -> Iterator[str]:
    yield from summary.ratio_sentences(findings.runs, findings.comparisons)
    yield from summary.cause_sentences(findings.runs)
    yield from summary.trigger_sentences(findings.runs, findings.slot_algorithms)
    yield from summary.decision_sentences(findings.runs, findings.wrong_values)
    yield from summary.frame_sentences(findings.runs, findings.repeated_detections)


def _sections(settings: Settings, findings: _Findings) -> Iterator[Section]:
    runs = findings.runs
    yield Section(title="Runs and arms", parts=(Words(text=_NOTE), tables.arms_table(ARMS), tables.runs_table(runs)))
    for name in LIDS:
        parts = (tables.table_2(runs, name), tables.table_2_of_the_paper(name))
        yield Section(title=f"Table 2: {label(name)}", parts=parts)
    yield _variables_section(runs)
    yield _intervals_section(findings)
    yield Section(
        title="Triggers",
        parts=(
            tables.triggers_table(runs, findings.slot_algorithms),
            tables.reduction_table(
                runs, findings.further_runs, (NAIVE.name, NAIVE_PACED.name), findings.slot_algorithms
            ),
        ),
    )
    yield Section(title="First knowledge and lag", parts=(tables.knowledge_table(runs),))
    yield _timeline_section(runs)
    yield Section(
        title="When decisions needed a value",
        parts=(tables.answers_table(runs), *_ring_drawings(runs, findings.wrong_values)),
    )
    yield Section(
        title="Decisions on wrong values",
        parts=(mistakes_table(findings.wrong_values), *photographs(findings.wrong_values, settings.folder)),
    )
    yield Section(title="Why values were wrong", parts=(tables.causes_table(runs),))
    yield Section(
        title="Frames", parts=(Words(text=" ".join(summary.frame_sentences(runs, findings.repeated_detections))),)
    )


def _variables_section(runs: Runs) -> Section:
    return Section(
        title="All fourteen variables",
        parts=(
            tables.ratio_table(
                runs,
                "ratio",
                "Ratio: the seconds with a right value as a share of the seconds with any value, in the common window, "
                "over all runs.",
            ),
            tables.ratio_table(
                runs,
                "strict ratio",
                "Strict ratio: the seconds with a right value as a share of all seconds, in the same window.",
            ),
            tables.seconds_table(runs),
        ),
    )


def _intervals_section(findings: _Findings) -> Section:
    table = tables.comparison_table(findings.comparisons)
    if not findings.further_runs.outcomes:
        return Section(title="How sure differences are", parts=(Words(text="No further seeds were run."),))
    caption = "Differences between arms with their 95 % intervals. To the right of zero, the first arm is better."
    return Section(title="How sure differences are", parts=(drawings.forest(findings.comparisons, caption), table))


def _timeline_section(runs: Runs) -> Section:
    caption = (
        "The true value and the value that each arm held over one run, as in P1's Figure 6. The background is "
        "coloured while the value is wrong."
    )
    return Section(
        title="One run over time",
        parts=tuple(drawings.timeline(outcome, LIDS[0], caption) for outcome in runs.outcomes[:1]),
    )


def _ring_drawings(runs: Runs, wrong_values: Sequence[Mistake]) -> Iterator[Drawing]:
    """Draw decisions, as P1's Figure 7 does, for each lid in the run with the most wrong values."""
    for name in LIDS:
        counts = [
            sum(mistake.outcome is outcome and mistake.decision.variable == name for mistake in wrong_values)
            for outcome in runs.outcomes
        ]
        outcome = runs.outcomes[counts.index(max(counts))]
        caption = (
            f"The decisions on {label(name)}, as in P1's Figure 7, in the run with the most wrong values at decisions."
        )
        yield drawings.decisions(outcome, name, caption)


def _results(findings: _Findings) -> Mapping[str, object]:
    return {
        "tables": results.runs_as_data(findings.runs),
        "further": results.runs_as_data(findings.further_runs),
        "intervals": results.comparisons_as_data(findings.comparisons),
        "decisions_on_wrong_values": results.mistakes_as_data(findings.wrong_values),
        "frames_detected_again": results.detected_as_data(findings.repeated_detections),
        "paper": results.paper_as_data(),
    }


EXPERIMENT = Experiment(
    name="lab-robustness",
    question="Does context make observers steadier, and how much perception does it save (P1, section 4.1)?",
    seeds=20,
    quick_seeds=2,
    trials=trials,
    judge=judge,
)
