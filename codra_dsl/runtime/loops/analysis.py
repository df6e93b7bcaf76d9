"""Analysis: from what is known to metrics, and from metrics to weights of actions (P2, sections 3.3 and 5.2).

All of it is a function of a scene, so that it can be asked what would have been.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

from codra_dsl.runtime.loops.declarations import InputModel, MapeModel, OutputModel, StageModel
from codra_dsl.runtime.loops.fuzzy.bounds import UNKNOWN, Bounds, is_finite, joined
from codra_dsl.runtime.loops.observations import Observation, Scene, number_of, possible
from codra_dsl.runtime.values.cell import BEFORE_ALL_S

MOST_BOXES = 256
"""How many boxes of its unknown inputs an output is asked about at most."""

Box = tuple[Bounds, ...]

MOST_KEPT = 4096
"""How many bounds are kept: what is unknown stays so for a while, and is asked about anew with each other change."""

_MOST_INFERRED = 64
"""How many sets of numbers a stage is kept for: most changes that wake a loop leave those that rules read."""

_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Degree:
    """With what degree an input is a term: bounds, that are one number if the input is known."""

    variable: str
    term: str
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Fired:
    """With what strength a rule acts: bounds, that are one number if what it reads is known."""

    text: str
    concludes: tuple[str, ...]
    place: str
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """What an output comes to.

    Attributes:
        name: the metric, or the action.
        bounds: all that it can be.
        value: what counts: the worse end of the bounds; None if it is unknown.
        evidence_s: of the oldest input that is known and that its rules read.
    """

    name: str
    variable: str
    bounds: Bounds
    value: float | None
    evidence_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Stage:
    """What one stage comes to.

    Attributes:
        inputs: what was read, in the engine's order.
    """

    inputs: tuple[Observation, ...] = ()
    degrees: tuple[Degree, ...] = ()
    rules: tuple[Fired, ...] = ()
    outputs: tuple[Judged, ...] = ()

    def value(self, name: str) -> float | None:
        """Return what counts of an output."""
        return next(each.value for each in self.outputs if each.name == name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Assessment:
    """What an analysis comes to.

    Attributes:
        scene: what was known, with the metrics.
    """

    scene: Scene
    metrics: Stage = field(default_factory=Stage)
    actions: Stage = field(default_factory=Stage)

    def weights(self) -> dict[str, float | None]:
        """Return the weight of each action."""
        return {each.name: each.value for each in self.actions.outputs}


def assess(model: MapeModel, scene: Scene, *, metrics: Mapping[str, float | None] | None = None) -> Assessment:
    """Return the metrics and weights of a scene.

    Args:
        model: of the loops.
        scene: all that the first stage reads, and what else the second one reads.
        metrics: what some metrics are to count as in the second stage, whatever the first says.
    """
    first = Stage() if model.metrics is None else infer(model.metrics, scene)
    judged = {each.variable: _observed(each) for each in first.outputs}
    whole = {**scene, **judged}
    for variable, value in (metrics or {}).items():
        whole[variable] = Observation(variable=variable, value=value, evidence_s=whole[variable].evidence_s)
    second = Stage() if model.actions is None else infer(model.actions, whole)
    return Assessment(scene=whole, metrics=first, actions=second)


def _observed(judged: Judged) -> Observation:
    because = "no rule may act" if judged.value is None else ""
    return Observation(variable=judged.variable, value=judged.value, evidence_s=judged.evidence_s, because=because)


def infer(model: StageModel, scene: Scene) -> Stage:
    """Return what a stage comes to."""
    inputs = tuple(scene[each.variable] for each in model.inputs)
    numbers = (number_of(each, seen.value) for each, seen in zip(model.inputs, inputs, strict=True))
    found = _inferred(model, tuple(None if number != number else number for number in numbers))
    return Stage(
        inputs=inputs,
        degrees=found.degrees,
        rules=found.rules,
        outputs=tuple(
            _judged(model, each, bounds, scene) for each, bounds in zip(model.outputs, found.values, strict=True)
        ),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Inferred:
    """What a stage makes of numbers, whenever they were seen."""

    degrees: tuple[Degree, ...]
    rules: tuple[Fired, ...]
    values: tuple[Bounds, ...]


@lru_cache(maxsize=_MOST_INFERRED)
def _inferred(model: StageModel, known: tuple[float | None, ...]) -> _Inferred:
    """Return what a stage makes of its inputs; None is what is unknown."""
    numbers = [math.nan if number is None else number for number in known]
    certain = model.infer(*numbers)
    values = [Bounds(value, value) if value == value else UNKNOWN for value in certain.values]
    strengths = [Bounds(strength, strength) for strength in certain.strengths]
    unknown = {each.variable for each, number in zip(model.inputs, known, strict=True) if number is None}
    if unknown:
        _widen(model, numbers, unknown, values, strengths)
    return _Inferred(
        degrees=tuple(_degrees(model.inputs, numbers)),
        rules=tuple(
            Fired(text=rule.text, concludes=rule.concludes, place=rule.place, low=found.low, high=found.high)
            for rule, found in zip(model.rules, strengths, strict=True)
        ),
        values=tuple(values),
    )


def _widen(
    model: StageModel, numbers: Sequence[float], unknown: set[str], values: list[Bounds], strengths: list[Bounds]
) -> None:
    """Put bounds in the place of what an unknown input has a say in."""
    for index, output in enumerate(model.outputs):
        reads = _reads(model, output)
        if unknown & reads:
            known = zip(model.inputs, numbers, strict=True)
            seen = (number if number == number and each.variable in reads else None for each, number in known)
            values[index] = _bounds(model, index, tuple(seen))
    choices = [_hull(possible(each, number)) for each, number in zip(model.inputs, numbers, strict=True)]
    found = model.infer_bounds(*choices).strengths
    for index, rule in enumerate(model.rules):
        if unknown & set(rule.reads):
            strengths[index] = found[index]


@lru_cache(maxsize=MOST_KEPT)
def _bounds(model: StageModel, index: int, numbers: tuple[float | None, ...]) -> Bounds:
    """Return all that an output can be.

    Args:
        model: of the stage.
        index: of the output.
        numbers: the inputs; None for what is unknown, and for what no rule about the output reads.
    """
    return _Cutting(model, numbers, index).bounds()


class _Cutting:
    """The bounds of one output: the union of those of boxes, into which its unknown inputs are cut.

    In a box two mentions of one input count as two inputs, so that no rule may seem to act though one surely does.
    Such a box is cut further, unless no rule acts in its middle.
    """

    def __init__(self, model: StageModel, numbers: Sequence[float | None], index: int) -> None:
        self._model = model
        self._index = index
        self._ranges = [each.range.high - each.range.low for each in model.inputs]
        reads = _reads(model, model.outputs[index])
        given = list(zip(model.inputs, numbers, strict=True))
        self._is_open = [number is None and each.variable in reads and not each.members for each, number in given]
        self._choices = [
            possible(each, math.nan if number is None else number)
            if number is not None or each.variable in reads
            else (each.range,)
            for each, number in given
        ]
        self._left = MOST_BOXES

    def bounds(self) -> Bounds:
        """Return all that the output can be."""
        found: Bounds | None = None
        pending = list(self._boxes())
        while pending:
            box = pending.pop()
            self._left -= 1
            value = self._model.infer_bounds(*box).values[self._index]
            halves = self._halves(box) if value.may_be_unknown and self._left > 0 else ()
            pending.extend(halves)
            if not halves:
                found = value if found is None else joined(found, value)
        assert found is not None
        return found

    def _boxes(self) -> Iterator[Box]:
        """Yield the boxes to begin with: members apart, ranges in equal pieces."""
        open_ones = sum(self._is_open)
        most = max(1.0, MOST_BOXES / 4 / math.prod(map(len, self._choices)))
        pieces = max(1, min(self._model.pieces, int(most ** (1 / max(1, open_ones)) + _ROUNDING)))
        cut = [
            tuple(part for choice in choices for part in _pieces(choice, pieces if is_open else 1))
            for choices, is_open in zip(self._choices, self._is_open, strict=True)
        ]
        yield from itertools.product(*cut)

    def _halves(self, box: Box) -> tuple[Box, ...]:
        """Return both halves of a box along its longest side; none if no rule acts in its middle."""
        middle = [each.low + (each.high - each.low) / 2.0 for each in box]
        value = self._model.infer(*middle).values[self._index]
        sides = [self._side(index, each) for index, each in enumerate(box)]
        longest = max(range(len(box)), key=sides.__getitem__)
        if value != value or sides[longest] <= 0.0:
            return ()
        parts = _pieces(box[longest], 2)
        return tuple((*box[:longest], part, *box[longest + 1 :]) for part in parts)

    def _side(self, index: int, bounds: Bounds) -> float:
        width = self._ranges[index]
        return (bounds.high - bounds.low) / width if self._is_open[index] and width and is_finite(bounds) else 0.0


def _pieces(bounds: Bounds, pieces: int) -> tuple[Bounds, ...]:
    if pieces == 1 or not (bounds.low < bounds.high and is_finite(bounds)):
        return (bounds,)
    ends = [bounds.low + (bounds.high - bounds.low) * index / pieces for index in range(pieces)] + [bounds.high]
    return tuple(Bounds(low, max(low, high)) for low, high in itertools.pairwise(ends))


def _hull(choices: Sequence[Bounds]) -> Bounds:
    return Bounds(min(each.low for each in choices), max(each.high for each in choices))


def _reads(model: StageModel, output: OutputModel) -> set[str]:
    return {variable for rule in model.rules if output.name in rule.concludes for variable in rule.reads}


def _judged(model: StageModel, output: OutputModel, bounds: Bounds, scene: Scene) -> Judged:
    worse = bounds.worse(output.worse)
    seen = (scene[variable] for variable in _reads(model, output))
    stamps = [each.evidence_s for each in seen if each.value is not None]
    return Judged(
        name=output.name,
        variable=output.variable,
        bounds=bounds,
        value=worse if math.isfinite(worse) else None,
        evidence_s=min(stamps, default=BEFORE_ALL_S),
    )


def _degrees(inputs: Sequence[InputModel], numbers: Sequence[float]) -> Iterator[Degree]:
    for model, number in zip(inputs, numbers, strict=True):
        for term, degree in model.terms.items():
            low, high = (degree(number),) * 2 if number == number else (0.0, 1.0)
            yield Degree(variable=model.variable, term=term, low=low, high=high)
