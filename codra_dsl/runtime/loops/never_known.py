"""Inputs of a loop that were never known: each of them is reported once, because nobody may notice them otherwise.

While an input is unknown, metrics are computed from their worse ends. So a loop works with an input that can never be
known, such as a rate over a time that the history of its variable does not cover, but it works badly.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Self

from codra_dsl.runtime.loops.declarations import LoopModel, MapeModel, RateModel
from codra_dsl.runtime.loops.observations import Observation, Scene

PATIENCE_PERIODS = 30
"""An input is reported if it was not known during this number of the loop's periods."""


class NeverKnownInputs:
    """Watches the inputs of one loop until each of them was known once or has been reported."""

    def __init__(self, inputs: tuple[str, ...], rates: Mapping[str, RateModel], period_s: float) -> None:
        """Watch inputs from the first analysis on.

        Args:
            inputs: the variables that the loop reads.
            rates: the rates among them that the loop computes. The time of a rate begins when its variable is known.
            period_s: the longest time between two analyses of the loop.
        """
        self._rates = rates
        self._patience_s = PATIENCE_PERIODS * period_s
        self._waiting_since_s: dict[str, float | None] = dict.fromkeys(inputs)

    @classmethod
    def of(cls, model: MapeModel, loop: LoopModel) -> Self:
        """Watch the inputs of a loop: what its rules, conditions and rates read, except metrics."""
        rates = {rate.variable: rate for rate in model.rates if rate.variable in loop.rates}
        courses = [course for course in model.courses if course.name in loop.adapt]
        outputs = {*loop.analyse, *(action for course in courses for action in course.choose)}
        stages = [stage for stage in (model.metrics, model.actions) if stage is not None]
        reads = {name for stage in stages for rule in stage.rules if outputs & {*rule.concludes} for name in rule.reads}
        terms = [rule.condition for course in courses for rule in course.always]
        terms += [parameter.value for parameter in model.parameters if parameter.name in loop.adapt]
        reads |= {name for term in terms for name in term.variables()}
        reads |= {rate.of for rate in rates.values()}
        metrics = () if model.metrics is None else model.metrics.outputs
        return cls(tuple(sorted(reads - {metric.variable for metric in metrics})), rates, loop.period_s)

    def resume(self) -> None:
        """Begin the waiting times again after a time without analyses."""
        self._waiting_since_s = dict.fromkeys(self._waiting_since_s)

    def overdue(self, scene: Scene, now_s: float) -> Iterator[tuple[Observation, float]]:
        """Yield each input that has waited too long, with the time for which it has waited; then no longer watch it."""
        for name, since_s in list(self._waiting_since_s.items()):
            observation = scene[name]
            if observation.value is not None:
                del self._waiting_since_s[name]
            elif since_s is None:
                self._waiting_since_s[name] = now_s if self._may_be_known(name, scene) else None
            elif now_s - since_s >= self._patience_of_s(name):
                del self._waiting_since_s[name]
                yield observation, now_s - since_s

    def _may_be_known(self, name: str, scene: Scene) -> bool:
        """Return whether an input could be known: a rate only if the variable from which it is computed is known."""
        return name not in self._rates or scene[self._rates[name].of].value is not None

    def _patience_of_s(self, name: str) -> float:
        over_s = self._rates[name].over_s if name in self._rates else 0.0
        return max(self._patience_s, over_s)
