"""What came of a trial, as plain data that can be kept in a file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from codra_dsl.runtime.values.conditions import Value
from codra_papers.experiments.lab.scoring import Piece

OWN_LOOK = "own look"
"""What took evidence that no arm took: the main execution itself."""

BEFORE_THE_ACTION = "before_the_action"
"""Why context has no answer although it knows the variable: it has no evidence from after the action."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Basis:
    """On what evidence a value rested that was not true when a decision needed it.

    Attributes:
        algorithm: that took the evidence; `OWN_LOOK` if the main execution did.
        evidence_s: when.
        values: what it returned.
        was_true: whether the value was true at that instant: if so, it has changed since; if not, it was seen wrongly.
        frame: the picture's file, relative to the folder of the trial's record; empty if there is none.
    """

    algorithm: str
    evidence_s: float
    values: Mapping[str, Any]
    was_true: bool
    frame: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """What a decision needed, and what each arm held then (P1, Figure 7).

    Attributes:
        truth: what was true when the main execution asked.
        held: the value that each arm held then, None for unknown.
        fresh: whether each arm's evidence was from after the action that the decision monitors; of a preview always.
        answer: what the main execution went by.
        answered_s: when it had that answer: it asked, waited and looked in between.
        waited_s: how long it waited for the arm that answers.
        looked_s: how long the robot looked by itself.
        has_looked: whether it did: context had no answer, or was not asked.
        unanswered: why context had no answer: the reason why the variable was unknown, or `BEFORE_THE_ACTION`; empty if
            it had one or was not asked.
        wrong: by arm, the basis of each value held at `instant_s` that was not true.
        wrong_answer: the basis of the answer if that was not true at `answered_s`.
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
    """A frame that was kept, and what an algorithm measured in it.

    Attributes:
        file: of the picture, relative to the folder of the trial.
        believed_map_from_camera: where the robot believed its camera to be: rotation, shape (3, 3), and translation.
    """

    file: str
    arm: str
    algorithm: str
    evidence_s: float
    values: Mapping[str, Any]
    believed_map_from_camera: tuple[Sequence[Sequence[float]], Sequence[float]]


@dataclass(frozen=True, slots=True)
class WrongSpan:
    """A span of time in which an arm held what was not true.

    Attributes:
        was_true: whether it was true at the instant of its evidence: if so, it has changed since; if not, it was seen
            wrongly.
    """

    start_s: float
    end_s: float
    was_true: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmOutcome:
    """What one arm held and did in a trial.

    Attributes:
        held: by variable.
        wrong: when a held value was not true, by variable.
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
    """What came of a trial. All of it is plain data: `to_json` and `from_json` are inverse to each other.

    Attributes:
        error: what ended the main execution early; None if nothing did.
        interruptions: instants in s and texts of errors after which it began anew.
        frames: how many frames were rendered for perception, and `perceived` how many instants it looked at.
        truth: what was true, by variable.
        skills: the main execution's skills as (name, start in s, end in s).
        kept: frames to be looked at again.
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
        """Return the pictures that were kept, relative to the folder of the trial."""
        told = [basis for each in self.decisions for basis in (*each.wrong.values(), each.wrong_answer)]
        return [*(basis.frame for basis in told if basis and basis.frame), *(kept.file for kept in self.kept)]

    def to_json(self) -> str:
        """Return it as JSON."""
        return json.dumps(asdict(self), separators=(",", ":"))

    @classmethod
    def from_json(cls, text: str) -> Outcome:
        """Return what `to_json` wrote."""
        told = json.loads(text)
        arms = {name: _arm(arm) for name, arm in told["arms"].items()}
        decisions = [_decision(each) for each in told["decisions"]]
        truth = {name: _pieces(found) for name, found in told["truth"].items()}
        told |= {"truth": truth, "arms": arms, "decisions": decisions}
        told |= {name: [tuple(each) for each in told[name]] for name in ("skills", "interruptions")}
        told["kept"] = [KeptFrame(**each) for each in told["kept"]]
        return cls(**told)


def _arm(told: Mapping[str, Any]) -> ArmOutcome:
    held = {name: _pieces(found) for name, found in told["held"].items()}
    wrong = {name: tuple(WrongSpan(**each) for each in found) for name, found in told["wrong"].items()}
    return ArmOutcome(**{**told, "held": held, "wrong": wrong})


def _decision(told: Mapping[str, Any]) -> Decision:
    wrong = {arm: Basis(**basis) for arm, basis in told["wrong"].items()}
    wrong_answer = None if told["wrong_answer"] is None else Basis(**told["wrong_answer"])
    return Decision(**{**told, "wrong": wrong, "wrong_answer": wrong_answer})


def _pieces(told: Sequence[Mapping[str, Any]]) -> tuple[Piece, ...]:
    return tuple(Piece(**each) for each in told)
