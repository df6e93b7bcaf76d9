"""The result of a review: changes with a category, the level of each category, and a verdict."""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum

from codra_dsl.language.diagnostics import Place
from codra_dsl.language.frozen import dataclass


class Level(StrEnum):
    """How bad a change is for a robot and its programs. The worst level is first."""

    BREAKING = "breaking"
    CAUTION = "caution"
    COMPATIBLE = "compatible"


class Verdict(StrEnum):
    """The level of the worst change, or `SAME` if nothing has changed."""

    BREAKING = "breaking"
    CAUTION = "caution"
    COMPATIBLE = "compatible"
    SAME = "same"


class Category(StrEnum):
    """The kinds of changes, the worst first. `docs/reference/diff.md` explains them."""

    # Breaking
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
    # Caution
    WIDENED = "widened"
    STRONGER = "stronger"
    SLOWER = "slower"
    UNDECLARED = "undeclared"
    REDEFINED = "redefined"
    PERCEIVED_OTHERWISE = "perceived-otherwise"
    RENAMED = "renamed"
    REPAIRED = "repaired"
    # Compatible
    ADDED = "added"
    OBSERVABLE = "observable"
    FASTER = "faster"
    EASED = "eased"
    WORDING = "wording"
    LAYOUT = "layout"

    @property
    def rank(self) -> int:
        """Return the position among the categories. The worst category has 0."""
        return list(Category).index(self)

    @property
    def level(self) -> Level:
        """Return how bad changes of this category are."""
        if self.rank < Category.WIDENED.rank:
            return Level.BREAKING
        return Level.CAUTION if self.rank < Category.ADDED.rank else Level.COMPATIBLE


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One change.

    Attributes:
        element: the identifier of the changed element, e.g. `lab/context/centrifuge_open`; for the spec itself, the
            name of the spec.
        key: the key that has changed, as specs spell it; empty for the element itself.
        message: the effect of the change, without the texts or values in A and B.
        old_text: the text or value in A; None if A has no value.
        new_text: the text or value in B; None if B has no value.
        old_place: the place in A; None if A has no place.
        new_place: the place in B; None if B has no place.
        is_allowed: whether `--allow` accepts the change, so that it does not affect the verdict.
    """

    category: Category
    element: str
    message: str
    key: str = ""
    old_text: str | None = None
    new_text: str | None = None
    old_place: Place | None = None
    new_place: Place | None = None
    is_allowed: bool = False

    @property
    def level(self) -> Level:
        """Return how bad the change is."""
        return self.category.level

    @property
    def spec(self) -> str:
        """Return the name of the spec that has changed."""
        return self.element.split("/", 1)[0]

    @property
    def text(self) -> str:
        """Return the message with the values in A and B."""
        value_texts = [
            f"{word} {value}" for word, value in (("was", self.old_text), ("is", self.new_text)) if value is not None
        ]
        return f"{self.message}: {', '.join(value_texts)}" if value_texts else self.message


@dataclass(frozen=True, slots=True, kw_only=True)
class Latency:
    """The longest time in seconds from the declaration of a variable until the variable is known, in A and in B."""

    element: str
    before_s: float
    after_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Review:
    """The result of comparing two versions.

    Attributes:
        changes: the changes, the worst category first, and within a category by element.
        latencies: the longest times of those variables whose times in A and B differ.
    """

    changes: tuple[Change, ...]
    latencies: tuple[Latency, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """Return the level of the worst change that was not allowed."""
        levels = {change.level for change in self.changes if not change.is_allowed}
        return next((Verdict(level.value) for level in Level if level in levels), Verdict.SAME)


def sort_changes(changes: Iterable[Change]) -> tuple[Change, ...]:
    """Return changes without duplicates, the worst category first, and within a category by element."""
    unique_changes = dict.fromkeys(changes)
    return tuple(
        sorted(unique_changes, key=lambda change: (change.category.rank, change.element, change.key, change.text))
    )
