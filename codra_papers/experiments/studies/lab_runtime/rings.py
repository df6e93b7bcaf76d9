"""P1's Figure 7: the decisions of a whole day, and the values that observers held at these instants."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from codra_papers.experiments.campaign.document import Section, Table, Words
from codra_papers.experiments.lab.arms import NEED_ON_EVENT
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.studies.factors.design import NAIVE_LIDS
from codra_papers.experiments.studies.lab_runtime.finding import Finding
from codra_papers.experiments.studies.lab_runtime.paper import DAY_NAIVE_WRONG_COUNT
from codra_papers.experiments.studies.robustness.drawings import decisions, rings
from codra_papers.experiments.studies.robustness.findings import LIDS, label

_STRIPS = 4
_VERDICTS = ("right", "wrong", "late", "unknown")
_COLUMNS = tuple(f"{time} an action: {verdict}" for time in ("before", "after") for verdict in _VERDICTS)
_NOTE = (
    "One arm answers the decisions of the day; further arms watch the same frames and answer nothing. A decision is"
    " judged at the instant at which the observers are needed: before an action when the robot asks, after an action"
    " when the robot stops waiting for them, because it has an answer or has waited long enough."
)


def judge_rings(outcome: Outcome) -> Finding:
    """Report the values that each arm held at the decisions of the day on the two lids."""
    counts = {name: {arm: _counts(outcome, name, arm) for arm in outcome.arms} for name in LIDS}
    arms = (NAIVE_LIDS.name, NEED_ON_EVENT.name)
    caption = "as in P1's Figure 7. The strips follow one another; together they are the whole day."
    return Finding(
        section=Section(
            title="Decisions of the day on lids",
            parts=[
                Words(text=_NOTE),
                *(decisions(outcome, name, f"Decisions on {label(name)}, {caption}", arms, _STRIPS) for name in LIDS),
                _table(counts),
            ],
        ),
        summary=[_sentence(counts["centrifuge_open"])],
        results={"day_decisions": counts},
    )


def _counts(outcome: Outcome, variable: str, arm: str) -> Mapping[str, int]:
    """Return the number of decisions for each of `_COLUMNS`. Late values are also wrong ones."""
    counts = Counter(dict.fromkeys(_COLUMNS, 0))
    variable_decisions = [decision for decision in outcome.decisions if decision.variable == variable]
    for decision, ring in zip(variable_decisions, rings(outcome, variable, arm), strict=True):
        time = "before an action" if decision.is_preview else "after an action"
        counts[f"{time}: {ring.verdict}"] += 1
        counts[f"{time}: late"] += any(
            span.was_true and span.start_s <= ring.instant_s < span.end_s for span in outcome.arms[arm].wrong[variable]
        )
    return dict(counts)


def _table(counts: Mapping[str, Mapping[str, Mapping[str, int]]]) -> Table:
    return Table(
        caption="Numbers of decisions by the value that an arm held. Late: those of the wrong values that were true"
        " when their evidence was taken; the truth has changed since.",
        header=("variable", "arm", *_COLUMNS),
        rows=[
            (label(name), arm, *(arm_counts[column] for column in _COLUMNS))
            for name, counts_by_arm in counts.items()
            for arm, arm_counts in counts_by_arm.items()
        ],
    )


def _sentence(counts_by_arm: Mapping[str, Mapping[str, int]]) -> str:
    texts = (
        f"{arm} {counts['before an action: wrong']} before and {counts['after an action: wrong']} after an action"
        for arm, counts in counts_by_arm.items()
    )
    return (
        f"Decisions of the day on centrifuge_open at which an arm held a wrong value: {'; '.join(texts)}. P1's naive"
        f" observer: {DAY_NAIVE_WRONG_COUNT}."
    )
