"""The outcome of a trial, as plain data that can be stored in a file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from codra_dsl.runtime.values.conditions import Value
from codra_papers.experiments.lab.scoring import Piece

OWN_LOOK = "own look"
"""The name of the algorithm for evidence that no arm took: the main execution looked itself."""

BEFORE_THE_ACTION = "before_the_action"
"""Why context has no answer although it knows the variable: the evidence is from before the action."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Basis:
    """The evidence for a value that was not true when a decision needed it.

    Attributes:
        algorithm: that took the evidence; `OWN_LOOK` if the main execution did.
        evidence_s: when it was taken.
        values: that the algorithm returned.
        was_true: whether the value was true at that instant. If so, it has changed since; if not, it was seen wrongly.
        frame: the picture's file, relative to the folder of the trial's record, or empty.
    """

    algorithm: str
    evidence_s: float
    values: Mapping[str, Any]
    was_true: bool
    frame: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """A decision of the main execution, and the values that each arm held then (P1, Figure 7).

    Attributes:
        truth: the true value when the main execution asked.
        held: the value that each arm held then, None for unknown.
        fresh: whether each arm's evidence was from after the action that the decision monitors; always for a preview.
        answer: the value that the main execution used.
        answered_s: when it had that answer: between asking and this instant it waited and looked.
        waited_s: how long it waited for the arm that answers.
        looked_s: how long the robot looked by itself.
        has_looked: whether it did, because context had no answer or was not asked.
        unanswered: why context had no answer: the reason why the variable was unknown, or `BEFORE_THE_ACTION`; empty if
            it had one or was not asked.
        wrong: by arm, the basis of each value held at `instant_s` that was not true.
        wrong_answer: the basis of the answer if it was not true at `answered_s`.
    """

    instant_s: float
    variable: str
    skill: str
    is_preview: bool
    truth: Value | None
    held: Mapping[str, Value | None]
    fresh: Mapping[str, bool]
    answer: Value | None
    answered_s: float
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
        file: of the picture, relative to the folder of the trial.
        believed_map_from_camera: the believed pose of the camera: rotation, shape (3, 3), and translation.
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
        was_true: whether it was true at the instant of its evidence. If so, it has changed since; if not, it was seen
            wrongly.
    """

    start_s: float
    end_s: float
    was_true: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmOutcome:
    """The values that one arm held in a trial, and its jobs.

    Attributes:
        held: the held values, by variable.
        wrong: the spans in which held values were not true, by variable.
        first_s: when an observer first identified each variable; None if never.
        triggers: how many jobs of each algorithm were started.
        slot_s: for how long its observers held slots.
    """

    held: Mapping[str, Sequence[Piece]]
    wrong: Mapping[str, Sequence[WrongSpan]]
    first_s: Mapping[str, float | None]
    triggers: Mapping[str, int]
    slot_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """The outcome of a trial. All of it is plain data: `from_json` is the inverse of `to_json`.

    Attributes:
        error: that ended the main execution early, or None.
        interruptions: instants in s and texts of errors after which it started again.
        frames: how many frames were rendered for perception.
        perceived: at how many instants perception looked.
        truth: the true values, by variable.
        skills: the main execution's skills as (name, start in s, end in s).
        kept: frames that are stored to be analysed again.
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
        """Return the stored pictures, relative to the folder of the trial."""
        bases = [basis for decision in self.decisions for basis in (*decision.wrong.values(), decision.wrong_answer)]
        return [*(basis.frame for basis in bases if basis and basis.frame), *(kept.file for kept in self.kept)]

    def to_json(self) -> str:
        """Return it as JSON."""
        return json.dumps(asdict(self), separators=(",", ":"))

    @classmethod
    def from_json(cls, text: str) -> Outcome:
        """Return the outcome that `to_json` wrote as this text."""
        content = json.loads(text)
        arms = {name: _arm(arm) for name, arm in content["arms"].items()}
        decisions = [_decision(decision) for decision in content["decisions"]]
        truth = {name: _pieces(timeline) for name, timeline in content["truth"].items()}
        content |= {"truth": truth, "arms": arms, "decisions": decisions}
        content |= {name: [tuple(entry) for entry in content[name]] for name in ("skills", "interruptions")}
        content["kept"] = [KeptFrame(**frame) for frame in content["kept"]]
        return cls(**content)


def _arm(content: Mapping[str, Any]) -> ArmOutcome:
    held = {name: _pieces(timeline) for name, timeline in content["held"].items()}
    wrong = {name: tuple(WrongSpan(**span) for span in spans) for name, spans in content["wrong"].items()}
    return ArmOutcome(**{**content, "held": held, "wrong": wrong})


def _decision(content: Mapping[str, Any]) -> Decision:
    wrong = {arm: Basis(**basis) for arm, basis in content["wrong"].items()}
    wrong_answer = None if content["wrong_answer"] is None else Basis(**content["wrong_answer"])
    return Decision(**{**content, "wrong": wrong, "wrong_answer": wrong_answer})


def _pieces(content: Sequence[Mapping[str, Any]]) -> tuple[Piece, ...]:
    return tuple(Piece(**piece) for piece in content)
