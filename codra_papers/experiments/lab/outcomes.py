"""The outcome of a trial, as plain data that can be stored in a file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from codra_dsl.runtime.values.conditions import Value
from codra_papers.experiments.lab.scoring import Piece

OWN_LOOK = "own look"
"""The value of `Basis.algorithm` for evidence that no arm took, because the main execution looked by itself."""

BEFORE_THE_ACTION = "before_the_action"
"""The value of `Decision.unanswered` if context knew the variable, but only by evidence from before the action."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Basis:
    """The evidence for a value that was not true when a decision needed the value.

    Attributes:
        algorithm: the algorithm that took the evidence; `OWN_LOOK` if the main execution looked by itself.
        evidence_s: when the evidence was taken.
        values: the values that the algorithm returned.
        was_true: whether the value was true at the instant of the evidence. If so, the truth has changed since then; if
            not, the value was seen wrongly.
        frame: the file of the picture, relative to the folder of the trial's frames; empty if there is no picture.
    """

    algorithm: str
    evidence_s: float
    values: Mapping[str, Any]
    was_true: bool
    frame: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """A decision of the main execution, and the values that the arms held at the same time (P1, Figure 7).

    Attributes:
        instant_s: when the main execution asked.
        variable: the variable that the decision needed.
        skill: the skill that was running.
        is_preview: True for a decision before an action; False for a decision after an action, to monitor the action.
        truth: the true value at `instant_s`.
        held: the value that each arm held at `instant_s`; None if the value was unknown.
        fresh: for each arm, whether the value was known from evidence after the action that the decision monitors; for
            a preview, whether the value was known.
        held_after_wait: the value that each arm held when the main execution had waited for observers; None if the
            value was unknown. Without a wait, the same as `held`.
        answer: the value that the main execution used.
        answered_s: when the main execution had the answer, after it had waited and looked.
        source: the algorithm or the writer whose value context answered with; empty if the robot looked.
        waited_s: how long the main execution waited for the arm that answers.
        looked_s: how long the robot looked by itself.
        has_looked: whether the robot looked by itself, because context had no answer or was not asked.
        unanswered: why context had no answer: the reason why the variable was unknown, or `BEFORE_THE_ACTION`. Empty if
            context had an answer or was not asked.
        wrong: the basis of each value that an arm held at `instant_s` and that was not true. The key is the arm.
        wrong_answer: the basis of the answer, if the answer was not true at `answered_s`.
    """

    instant_s: float
    variable: str
    skill: str
    is_preview: bool
    truth: Value | None
    held: Mapping[str, Value | None]
    fresh: Mapping[str, bool]
    held_after_wait: Mapping[str, Value | None]
    answer: Value | None
    answered_s: float
    source: str
    waited_s: float
    looked_s: float
    has_looked: bool
    unanswered: str
    wrong: Mapping[str, Basis]
    wrong_answer: Basis | None


@dataclass(frozen=True, slots=True, kw_only=True)
class KeptFrame:
    """A stored frame, and the values that an algorithm measured in it.

    Attributes:
        file: the file of the picture, relative to the folder of the trial's frames.
        arm: the arm whose job used the frame.
        algorithm: the algorithm of the job.
        evidence_s: when the frame was taken.
        values: the values that the algorithm returned.
        believed_map_from_camera: the believed pose of the camera: its rotation, shape (3, 3), and its translation.
    """

    file: str
    arm: str
    algorithm: str
    evidence_s: float
    values: Mapping[str, Any]
    believed_map_from_camera: tuple[Sequence[Sequence[float]], Sequence[float]]


@dataclass(frozen=True, slots=True)
class WrongSpan:
    """A span of time in which an arm held a value that was not true.

    Attributes:
        was_true: whether the value was true at the instant of its evidence. If so, the truth has changed since then; if
            not, the value was seen wrongly.
    """

    start_s: float
    end_s: float
    was_true: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmOutcome:
    """The values that one arm held in a trial, and its jobs.

    Attributes:
        held: the held values of each variable.
        wrong: for each variable, the spans in which the held value was not true.
        first_s: when an observer first identified each variable; None if no observer did.
        triggers: how many jobs of each algorithm were started.
        observable_triggers: for each algorithm whose preconditions in the trial's spec are names of variables, how many
            jobs were started while these preconditions were true. The arm itself may have no preconditions.
        slot_s: how long the observers of the arm held slots.
        sources: the source of the held value of each variable that has alternatives in the trial's spec.
    """

    held: Mapping[str, Sequence[Piece]]
    wrong: Mapping[str, Sequence[WrongSpan]]
    first_s: Mapping[str, float | None]
    triggers: Mapping[str, int]
    observable_triggers: Mapping[str, int]
    slot_s: float
    sources: Mapping[str, Sequence[Piece]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """The outcome of a trial, which consists of plain data: `from_json` is the inverse of `to_json`.

    Attributes:
        error: the error that ended the main execution early, or None.
        interruptions: the errors after which the main execution started again, as (instant in s, text).
        frames: how many frames were rendered for perception.
        perceived: the number of instants at which perception took frames.
        truth: the true values of each variable.
        skills: the skills of the main execution as (name, start in s, end in s).
        kept: the frames that are stored to be analysed again.
    """

    name: str
    seed: int
    duration_s: float
    loops: int
    error: str | None
    interruptions: Sequence[tuple[float, str]]
    frames: int
    perceived: int
    truth: Mapping[str, Sequence[Piece]]
    arms: Mapping[str, ArmOutcome]
    decisions: Sequence[Decision]
    skills: Sequence[tuple[str, float, float]]
    kept: Sequence[KeptFrame]

    def files(self) -> Sequence[str]:
        """Return the files of stored pictures, relative to the folder of the trial's frames."""
        bases = [basis for decision in self.decisions for basis in (*decision.wrong.values(), decision.wrong_answer)]
        return [*(basis.frame for basis in bases if basis and basis.frame), *(kept.file for kept in self.kept)]

    def to_json(self) -> str:
        """Return the outcome as JSON."""
        return json.dumps(asdict(self), separators=(",", ":"))

    @classmethod
    def from_json(cls, text: str) -> Outcome:
        """Return the outcome from the JSON text that `to_json` returned."""
        content = json.loads(text)
        arms = {name: _arm(arm) for name, arm in content["arms"].items()}
        decisions = [_decision(decision) for decision in content["decisions"]]
        truth = {name: _pieces(timeline) for name, timeline in content["truth"].items()}
        content |= {"truth": truth, "arms": arms, "decisions": decisions}
        content |= {name: [tuple(entry) for entry in content[name]] for name in ("skills", "interruptions")}
        content["kept"] = [KeptFrame(**frame) for frame in content["kept"]]
        return cls(**content)


def _arm(content: Mapping[str, Any]) -> ArmOutcome:
    held, sources = (
        {name: _pieces(timeline) for name, timeline in content[key].items()} for key in ("held", "sources")
    )
    wrong = {name: tuple(WrongSpan(**span) for span in spans) for name, spans in content["wrong"].items()}
    return ArmOutcome(**{**content, "held": held, "wrong": wrong, "sources": sources})


def _decision(content: Mapping[str, Any]) -> Decision:
    wrong = {arm: Basis(**basis) for arm, basis in content["wrong"].items()}
    wrong_answer = None if content["wrong_answer"] is None else Basis(**content["wrong_answer"])
    return Decision(**{**content, "wrong": wrong, "wrong_answer": wrong_answer})


def _pieces(content: Sequence[Mapping[str, Any]]) -> tuple[Piece, ...]:
    return tuple(Piece(**piece) for piece in content)
