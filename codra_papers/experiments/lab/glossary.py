"""The words in the tables of reports on the laboratory, for readers who do not know them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from codra_papers.experiments.campaign.document import Section, Table

MEANINGS: Mapping[str, str] = MappingProxyType(
    {
        "arm": "one of the compared sets of observers; all arms of a run see the same frames",
        "the spec": "how the spec of the arm differs from the spec under test",
        "loops": "batches of samples that the robot took through both machines and back",
        "perceived": "of frames: perception looked at them",
        "right": "the arm held the true value",
        "wrong": "the arm held a value that was not true",
        "unknown": "the arm held no value",
        "late": "wrong now, but true when the evidence was taken: the truth has changed since",
        "seen wrongly": "wrong already when the evidence was taken",
        "ratio": "right seconds as a share of the seconds with any value, as in P1",
        "strict": "right seconds as a share of all seconds",
        "balanced": "the mean of the ratios while the variable is true and while it is false",
        "constant": "the ratio of an observer that always gives the more frequent true value",
        "window": "the part of a run in which arms are compared: it begins when every arm has identified the variable",
        "lag": "the time from a change of the truth until the arm held the new value",
        "p90": "nine of ten lags are at most this long",
        "never seen": "changes of the truth that the arm did not notice before the next change",
        "trigger": "a job that was started: one call of a perception algorithm by an observer",
        "slot": "the place in which the jobs of an arm that look at frames run, one after the other",
        "preview": "a decision before an action, whether the action is needed or possible",
        "monitoring": "a decision after an action, whether the action reached its goal",
        "perception task": "a decision for which a robot without observers moves its camera and looks",
        "fell back": "the value was unknown, so that a robot would look by itself",
        "fresh": "the evidence was taken after the action that the decision monitors",
        "evidence": "the frame, or the measured distance, from which a value was identified",
        "from s": "the instant at which the evidence was taken",
        "measured": "what the algorithm returned for the evidence",
        "interruptions": "errors after which somebody repaired the situation and the robot started again",
        "reason": "why the variable was unknown when the robot began to look",
        "degrees of freedom": "a parameter of Welch's t-test, from the sizes and variances of the samples",
        "Hedges' g": "the difference in multiples of the standard deviation, corrected for small samples",
    }
)
"""The meaning of each word."""


def glossary(sections: Sequence[Section]) -> Section:
    """Return a section that explains the words of `MEANINGS` that are in the heads of other sections' tables."""
    heads = [head for section in sections for part in section.parts if isinstance(part, Table) for head in _heads(part)]
    rows = [(word, meaning) for word, meaning in MEANINGS.items() if any(word in head for head in heads)]
    caption = "Words in the heads of columns and rows."
    return Section(title="Words in the tables", parts=(Table(caption=caption, header=("word", "meaning"), rows=rows),))


def _heads(table: Table) -> Sequence[str]:
    """Return the heads of the columns, and the texts of the first two columns, which can be heads of rows."""
    return [*table.header, *(cell for row in table.rows for cell in row[:2] if isinstance(cell, str))]
