"""What a review of two versions says: changes with a category each, a level for each category, and a verdict."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum

from codra_dsl.diagnostics import Place


class Level(StrEnum):
    """How bad a change is for a robot and its programs, worst first."""

    BREAKING = "breaking"
    CAUTION = "caution"
    COMPATIBLE = "compatible"


class Verdict(StrEnum):
    """What the worst change is, or that there is none."""

    BREAKING = "breaking"
    CAUTION = "caution"
    COMPATIBLE = "compatible"
    SAME = "same"


class Category(StrEnum):
    """The kinds of change; `docs/reference/diff.md` says what each means."""

    REMOVED = "removed"
    RETYPED = "retyped"
    NARROWED = "narrowed"
    UNWRITABLE = "unwritable"
    NEEDS_HANDLE = "needs-handle"
    API = "api"
    CONTRACT = "contract"
    UNOBSERVABLE = "unobservable"
    CYCLIC = "cyclic"
    INVALID = "invalid"
    WEAKER = "weaker"
    GUARD_CHANGED = "guard-changed"
    WIDENED = "widened"
    STRONGER = "stronger"
    SLOWER = "slower"
    UNDECLARED = "undeclared"
    REDEFINED = "redefined"
    PERCEIVED_OTHERWISE = "perceived-otherwise"
    RENAMED = "renamed"
    REPAIRED = "repaired"
    ADDED = "added"
    OBSERVABLE = "observable"
    FASTER = "faster"
    EASED = "eased"
    WORDING = "wording"
    LAYOUT = "layout"

    @property
    def level(self) -> Level:
        """Return how bad changes of this category are."""
        return _LEVELS[self]


_CAUTION = (
    *(Category.WIDENED, Category.STRONGER, Category.SLOWER, Category.UNDECLARED, Category.REDEFINED),
    *(Category.PERCEIVED_OTHERWISE, Category.RENAMED, Category.REPAIRED),
)
_COMPATIBLE = (
    *(Category.ADDED, Category.OBSERVABLE, Category.FASTER, Category.EASED, Category.WORDING, Category.LAYOUT),
)
_LEVELS: Mapping[Category, Level] = (
    dict.fromkeys(Category, Level.BREAKING)
    | dict.fromkeys(_CAUTION, Level.CAUTION)
    | dict.fromkeys(_COMPATIBLE, Level.COMPATIBLE)
)
_ORDER = {category: index for index, category in enumerate(Category)}


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One change.

    Attributes:
        element: what has changed, e.g. `lab/context/centrifuge_open`; the spec itself is called by its name.
        key: what of it, as it is spelled in specs; empty where all of it is meant.
        message: what that means, without `was` and `now`.
        was: the text or value in A, None where there is none; `now` that in B.
        before: the place in A, None where there is none; `after` that in B.
        allowed: whether it was accepted and does not count.
    """

    category: Category
    element: str
    message: str
    key: str = ""
    was: str | None = None
    now: str | None = None
    before: Place | None = None
    after: Place | None = None
    allowed: bool = False

    @property
    def level(self) -> Level:
        """Return how bad it is."""
        return self.category.level

    @property
    def spec(self) -> str:
        """Return the name of the spec that it is about."""
        return self.element.split("/", 1)[0]

    @property
    def text(self) -> str:
        """Return the message with what was and what is now."""
        told = [f"{word} {value}" for word, value in (("was", self.was), ("is", self.now)) if value is not None]
        return f"{self.message}: {', '.join(told)}" if told else self.message


@dataclass(frozen=True, slots=True, kw_only=True)
class Latency:
    """How long it takes at worst, in seconds, from declaring a variable until it is known: in A, and in B."""

    element: str
    before_s: float
    after_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Review:
    """What a comparison of two versions says.

    Attributes:
        changes: worst first, then by category and element.
        latencies: of the variables for which it is another in B.
    """

    changes: tuple[Change, ...]
    latencies: tuple[Latency, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """Return the level of the worst change that was not allowed."""
        found = {change.level for change in self.changes if not change.allowed}
        return next((Verdict(level.value) for level in Level if level in found), Verdict.SAME)


def in_order(changes: Iterable[Change]) -> tuple[Change, ...]:
    """Return changes worst first, then by category and element, each once."""
    unique = dict.fromkeys(changes)
    return tuple(sorted(unique, key=lambda each: (_ORDER[each.category], each.element, each.key, each.text)))
