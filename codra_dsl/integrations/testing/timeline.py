"""What a timeline says, as frozen values: stories, each a row of moments."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from codra_dsl.language.diagnostics import Place
from codra_dsl.language.load.yaml.source import Source
from codra_dsl.language.model import Literal
from codra_dsl.runtime import Reason


@dataclass(frozen=True, slots=True, kw_only=True)
class Maker:
    """What makes the handle of a resource, anew for each story.

    Attributes:
        call: `module:name` of a class or function.
        arguments: literals that it is called with.
    """

    call: str
    arguments: Mapping[str, Literal]
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class Saying:
    """What an agent writes; None stands for silence."""

    agent: str
    values: Mapping[str, Literal | None] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """How an algorithm fails.

    Attributes:
        raises: the text of the error that it raises.
        hangs: whether it never returns.
        garbage: what it returns whatever the spec says, alone in a tuple; empty if that is not the fault.
        late_s: how much later its result comes.
        jobs: how many jobs it is for.
    """

    raises: str | None = None
    hangs: bool = False
    garbage: tuple[object, ...] = ()
    late_s: float = 0.0
    jobs: float = math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class Behaviour:
    """How an algorithm behaves from here on; what is None stays as it was.

    Attributes:
        returns: values that change.
        takes_s: how long a job takes.
        evidence_s: when its evidence is taken, from start to stamp, counted from the start of the job.
        fault: how it fails; none, if it does not.
    """

    algorithm: str
    place: Place
    returns: Mapping[str, Literal | None] | None = None
    takes_s: float | None = None
    evidence_s: tuple[float, float] | None = None
    fault: Fault | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Alteration:
    """Attributes of a handle that change."""

    resource: str
    attributes: Mapping[str, object]
    place: Place


Change = Saying | Behaviour | Alteration
"""Something that changes in the world."""


class Verb(StrEnum):
    """What a main execution can do; each is a key of `main_execution`."""

    DECLARE = "declare"
    WITHDRAW = "withdraw"
    SET = "set"
    EXPECT = "expect"
    BEGIN = "begin"
    ACT = "act"
    ACTED = "acted"
    END = "end"
    DECIDE = "decide"


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """What a decision asks, and what the robot finds when it looks itself; `since_s` counts from the beginning."""

    otherwise: Literal | None = None
    max_age_s: float = math.inf
    since_s: float = -math.inf
    wait_up_to_s: float = 0.0
    shadow: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """Something that the main execution does.

    Attributes:
        names: of variables or skills.
        value: what it sets.
        asked: what it decides on.
    """

    verb: Verb
    names: tuple[str, ...]
    place: Place
    value: Literal | None = None
    asked: Asked = field(default_factory=Asked)


@dataclass(frozen=True, slots=True, kw_only=True)
class Belief:
    """What must be known of a variable.

    Attributes:
        is_unknown: whether it must be unknown; with `reason`, for that reason.
        value: that it must have, if `is_stated`.
        within: how far a number may be from it; None if nearly equal is meant.
        source: who must have written it; empty for anybody.
        because: words that must occur in why it is so.
    """

    variable: str
    place: Place
    is_unknown: bool = False
    reason: Reason | None = None
    is_stated: bool = False
    value: Literal | None = None
    within: float | None = None
    source: str = ""
    because: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Running:
    """Whether an observer must run."""

    observer: str
    is_running: bool
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """How the last decision on a variable must have been answered: `answered`, `fell_back` or `shadowed`."""

    variable: str
    how: str
    place: Place


Check = Belief | Running | Outcome
"""Something that must be so."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Moment:
    """One instant, counted from the beginning: what changes, what the main execution does, what must be so."""

    at_s: float
    place: Place
    changes: tuple[Change, ...] = ()
    steps: tuple[Step, ...] = ()
    checks: tuple[Check, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Story:
    """A row of moments; the first has what holds from the beginning of every story."""

    name: str
    place: Place
    moments: tuple[Moment, ...]

    @property
    def end_s(self) -> float:
        """Return the instant of the last moment."""
        return self.moments[-1].at_s

    @property
    def scripted(self) -> frozenset[str]:
        """Return the algorithms that the story speaks for; others are called."""
        changes = (change for moment in self.moments for change in moment.changes)
        return frozenset(each.algorithm for each in changes if isinstance(each, Behaviour) and each.returns is not None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Timeline:
    """A whole file.

    Attributes:
        spec: the name of the spec that is tested.
        seed: of the chance that jobs see.
        makers: of handles, by resource.
        every_s: how often an agent repeats what it said last, by agent.
    """

    source: Source
    spec: str
    seed: int
    makers: Mapping[str, Maker]
    every_s: Mapping[str, float]
    stories: tuple[Story, ...]
