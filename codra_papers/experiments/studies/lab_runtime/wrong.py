"""The decisions that were made on a value that was not true, with their causes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from codra_papers.experiments.campaign.campaign import TRIALS
from codra_papers.experiments.campaign.document import Part, Photograph, Section, Table, Words
from codra_papers.experiments.lab.outcomes import OWN_LOOK, Basis, Decision, Outcome
from codra_papers.experiments.lab.tables import values_text
from codra_papers.experiments.studies.lab_runtime.finding import Finding, rounded

PHOTOGRAPH_LIMIT = 12
"""The maximum number of frames that are shown. The table lists the frames of all wrong decisions."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mistake:
    """A decision that was made on a wrong value, and the evidence for this value."""

    trial: str
    decision: Decision
    basis: Basis

    @property
    def cause(self) -> str:
        """Return the reason why the value was wrong."""
        if self.basis.was_true:
            return "was true in the evidence and has changed since"
        if self.basis.algorithm == OWN_LOOK:
            return "the robot's own look was wrong"
        measured_text = values_text(dict(sorted(self.basis.values.items())))
        return f"seen wrongly: {measured_text}" if measured_text else "not observed: the value was written"


def mistakes(outcomes: Sequence[Outcome]) -> Sequence[Mistake]:
    """Return all decisions on wrong values. A value is wrong if it was not true when the decision was answered."""
    return [
        Mistake(trial=outcome.name, decision=decision, basis=decision.wrong_answer)
        for outcome in outcomes
        for decision in outcome.decisions
        if decision.wrong_answer is not None
    ]


def judge_wrong(outcomes: Sequence[Outcome], folder: Path) -> Finding:
    """Report decisions on wrong values.

    Args:
        outcomes: the outcomes of all runs.
        folder: the folder of the experiment; it contains the stored frames.
    """
    wrong_decisions = mistakes(outcomes)
    all_decisions = [decision for outcome in outcomes for decision in outcome.decisions]
    look_count = sum(decision.has_looked for decision in all_decisions)
    wrong_look_count = sum(mistake.decision.has_looked for mistake in wrong_decisions)
    corrected_count = sum(
        next(iter(outcome.arms)) in decision.wrong and decision.wrong_answer is None  # the first arm answers
        for outcome in outcomes
        if outcome.arms
        for decision in outcome.decisions
    )
    sentence = (
        f"Of {len(all_decisions)} decisions in all runs, context answered {len(all_decisions) - look_count};"
        f" {len(wrong_decisions) - wrong_look_count} of these answers were not true. For the other {look_count}"
        f" decisions, the robot looked by itself; {wrong_look_count} of its answers were not true."
    )
    return Finding(
        section=Section(
            title="Decisions on wrong values",
            parts=[
                Words(
                    text=f"{sentence} An answer is judged when it is given, after waiting or looking."
                    f" {corrected_count} times, context held a wrong value when the decision was requested,"
                    " but the decision was made on a right value."
                ),
                _table(wrong_decisions),
                *_photographs(wrong_decisions, folder),
            ],
        ),
        summary=[sentence],
        results={
            "decisions": len(all_decisions),
            "wrong_decisions": [_mistake_as_data(mistake) for mistake in wrong_decisions],
        },
    )


def _table(wrong_decisions: Sequence[Mistake]) -> Table:
    return Table(
        caption="Decisions on wrong values. Evidence: the algorithm that took it, or the robot's own look; from: the"
        " instant at which it was taken. Cause: why the value was wrong. Frame: the stored image.",
        header=("run", "given at s", "variable", "skill", "answer", "evidence", "from s", "cause", "frame"),
        rows=[
            (
                mistake.trial,
                rounded(mistake.decision.answered_s),
                mistake.decision.variable,
                mistake.decision.skill,
                mistake.decision.answer,
                mistake.basis.algorithm,
                rounded(mistake.basis.evidence_s),
                mistake.cause,
                mistake.basis.frame or None,
            )
            for mistake in wrong_decisions
        ],
    )


def _photographs(wrong_decisions: Sequence[Mistake], folder: Path) -> Iterator[Part]:
    for mistake in [mistake for mistake in wrong_decisions if mistake.basis.frame][:PHOTOGRAPH_LIMIT]:
        decision = mistake.decision
        yield Photograph(
            caption=f"{mistake.trial}: {decision.variable} was taken for {decision.answer} at"
            f" {decision.answered_s:.1f} s; {mistake.cause}.",
            path=folder / TRIALS / mistake.trial / mistake.basis.frame,
        )


def _mistake_as_data(mistake: Mistake) -> Mapping[str, Any]:
    decision = mistake.decision
    return {
        "trial": mistake.trial,
        "instant_s": decision.instant_s,
        "answered_s": decision.answered_s,
        "variable": decision.variable,
        "skill": decision.skill,
        "answer": decision.answer,
        "has_looked": decision.has_looked,
        "cause": mistake.cause,
        "basis": asdict(mistake.basis),
    }
