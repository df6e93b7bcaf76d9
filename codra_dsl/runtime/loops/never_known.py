"""Inputs of a loop that were never known: each of them is reported once, because they could otherwise stay unnoticed.

While an input is unknown, metrics are computed from their worse ends. So a loop works with an input that can never be
known, such as a rate over a time that the history of its variable does not cover, but it works badly.
"""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.runtime.loops.declarations import LoopModel, MapeModel
from codra_dsl.runtime.loops.observations import Observation, Scene

PATIENCE_PERIODS = 30
"""An input is reported if it was not known during this number of the loop's periods."""


class NeverKnownInputs:
    """Watches the inputs of one loop until each of them was known once or has been reported."""

    def __init__(self, model: MapeModel, loop: LoopModel) -> None:
        """Watch the inputs of a loop: what its rules, conditions and rates read, except metrics."""
        self._rates = {rate.variable: rate for rate in model.rates if rate.variable in loop.rates}
        self._patience_s = PATIENCE_PERIODS * loop.period_s
        self._waiting_since_s: dict[str, float | None] = dict.fromkeys(_inputs(model, loop))

    def resume(self) -> None:
        """Begin the waiting times again after a time without analyses."""
        self._waiting_since_s = dict.fromkeys(self._waiting_since_s)

    def overdue(self, scene: Scene, now_s: float) -> Iterator[tuple[Observation, float]]:
        """Yield each input that has waited too long, with the time for which it has waited; then no longer watch it.

        A rate begins to wait when the variable from which it is computed is known, and waits for at least its `over`.
        """
        for name, since_s in list(self._waiting_since_s.items()):
            observation, rate = scene[name], self._rates.get(name)
            if observation.value is not None:
                del self._waiting_since_s[name]
            elif since_s is None:
                may_be_known = rate is None or scene[rate.of].value is not None
                self._waiting_since_s[name] = now_s if may_be_known else None
            elif now_s - since_s >= max(self._patience_s, 0.0 if rate is None else rate.over_s):
                del self._waiting_since_s[name]
                yield observation, now_s - since_s


def _inputs(model: MapeModel, loop: LoopModel) -> list[str]:
    courses = [course for course in model.courses if course.name in loop.adapt]
    outputs = {*loop.analyse, *(action for course in courses for action in course.choose)}
    stages = [stage for stage in (model.metrics, model.actions) if stage is not None]
    reads = {name for stage in stages for rule in stage.rules if outputs & {*rule.concludes} for name in rule.reads}
    terms = [rule.condition for course in courses for rule in course.always]
    terms += [parameter.value for parameter in model.parameters if parameter.name in loop.adapt]
    reads |= {name for term in terms for name in term.variables()}
    reads |= {rate.of for rate in model.rates if rate.variable in loop.rates}
    metrics = () if model.metrics is None else model.metrics.outputs
    return sorted(reads - {metric.variable for metric in metrics})
