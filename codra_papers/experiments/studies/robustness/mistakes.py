"""The decisions at which an arm held a value that was not true, with the evidence for this value."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from codra_papers.experiments.campaign.campaign import TRIALS
from codra_papers.experiments.campaign.cells import plain_table
from codra_papers.experiments.campaign.document import Cell, Photograph, Table
from codra_papers.experiments.lab.outcomes import Basis, Decision, Outcome
from codra_papers.experiments.lab.tables import values_text
from codra_papers.experiments.studies.robustness.findings import VARIABLES, Runs, label


@dataclass(frozen=True, slots=True, kw_only=True)
class Mistake:
    """A wrong value that an arm held when a decision needed the value."""

    outcome: Outcome
    decision: Decision
    arm: str
    basis: Basis

    @property
    def cause(self) -> str:
        """Return the reason why the value was wrong."""
        return "has changed since" if self.basis.was_true else "seen wrongly"

    @property
    def purpose(self) -> str:
        """Return the purpose of the decision (P1, Figure 1)."""
        return "preview" if self.decision.is_preview else "monitoring"

    @property
    def frame(self) -> str:
        """Return the file of the frame, relative to the experiment's folder, or an empty text if there is no frame."""
        return f"{TRIALS}/{self.outcome.name}/{self.basis.frame}" if self.basis.frame else ""


def mistakes(runs: Runs) -> Sequence[Mistake]:
    """Return all wrong values at decisions, in order of runs and time."""
    return tuple(
        Mistake(outcome=outcome, decision=decision, arm=arm, basis=basis)
        for outcome in runs.outcomes
        for decision in outcome.decisions
        if decision.variable in VARIABLES
        for arm, basis in decision.wrong.items()
    )


def mistakes_table(wrong_values: Sequence[Mistake]) -> Table:
    """Return a table of wrong values with their evidence."""
    header = ("seed", "at s", "variable", "for", "skill", "arm", "held", "true", "cause", "fresh", "algorithm")
    caption = (
        "Every decision at which an arm held a value that was not true, with the evidence for the value, and the frame "
        "of this evidence in the folder of this report. For: whether the decision is a preview, before an action, or "
        "monitors an action. Algorithm, measured: the algorithm and what it returned. Fresh: the evidence was taken "
        "after the monitored action."
    )
    return plain_table(
        caption, (*header, "evidence at s", "measured", "frame"), [tuple(_cells(mistake)) for mistake in wrong_values]
    )


def _cells(mistake: Mistake) -> Iterator[Cell]:
    decision, basis = mistake.decision, mistake.basis
    yield from (mistake.outcome.seed, round(decision.instant_s, 1), label(decision.variable), mistake.purpose)
    yield from (decision.skill, mistake.arm, decision.held[mistake.arm], decision.truth, mistake.cause)
    yield from (decision.fresh[mistake.arm], basis.algorithm, round(basis.evidence_s, 1), values_text(basis.values))
    yield mistake.frame or None


def photographs(wrong_values: Sequence[Mistake], folder: Path) -> Sequence[Photograph]:
    """Return, for each arm and each cause, the frame of the first mistake that has a frame.

    Args:
        wrong_values: the wrong values, in order of runs and time.
        folder: the folder of the experiment.
    """
    first_mistakes: dict[tuple[str, str], Mistake] = {}
    for mistake in wrong_values:
        if mistake.frame and (folder / mistake.frame).exists():
            first_mistakes.setdefault((mistake.arm, mistake.cause), mistake)
    return [Photograph(caption=_caption(mistake), path=folder / mistake.frame) for mistake in first_mistakes.values()]


def _caption(mistake: Mistake) -> str:
    decision, basis = mistake.decision, mistake.basis
    held, true_value = (str(value).lower() for value in (decision.held[mistake.arm], decision.truth))
    return (
        f"{mistake.arm}, seed {mistake.outcome.seed}: {label(decision.variable)} held as {held} when it was needed at "
        f"{decision.instant_s:.1f} s; the true value was {true_value}, {mistake.cause}. This frame was "
        f"taken at {basis.evidence_s:.1f} s; {basis.algorithm} measured {values_text(basis.values)}."
    )
