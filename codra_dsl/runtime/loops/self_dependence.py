"""Detect loops that depend on their own results, and slow down their analyses.

A loop analyses when an input changes. If this input is a result of the loop, or follows from one, a further analysis
follows, and so on until the results stay the same. If they never do, the loop would analyse without an end: in real
time as fast as the machine can, and in simulated time at one instant.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping

from codra_dsl.runtime.loops.declarations import LoopModel, MapeModel, OutputModel, StageModel
from codra_dsl.runtime.values.model import VariableModel

MAX_CHANGES_IN_A_ROW = 10
"""If a result changes in this number of analyses in a row, all caused only by results, it depends on itself."""


def fed_back_inputs(
    model: MapeModel, watches: Mapping[str, Collection[str]], variables: Iterable[VariableModel]
) -> dict[str, frozenset[str]]:
    """Return, for each loop, those of its inputs that can change because of its own results.

    Results can return to a loop through derived variables, and through other loops that read them.

    Args:
        model: the model of all loops.
        watches: for each loop, the variables whose changes trigger an analysis.
        variables: the context-variables.
    """
    results = {loop.name: frozenset(_results(model, loop)) for loop in model.loops}
    readers = [(frozenset(watches[name]), changes) for name, changes in results.items()]
    derived_terms = ((variable.name, variable.derived) for variable in variables)
    readers += [(term.variables(), frozenset((name,))) for name, term in derived_terms if term is not None]
    return {name: frozenset(watches[name]) & _reachable(results[name], readers) for name in results}


def _reachable(names: Iterable[str], readers: Collection[tuple[frozenset[str], frozenset[str]]]) -> set[str]:
    """Return names, and the names that can change because of them. A reader has the names that it reads and changes."""
    reached, new_names = set[str](), set(names)
    while new_names:
        reached |= new_names
        changed_sets = [changes for reads, changes in readers if not reads.isdisjoint(new_names)]
        new_names = set[str]().union(*changed_sets) - reached
    return reached


def _results(model: MapeModel, loop: LoopModel) -> Iterator[str]:
    """Yield the variables that a loop writes."""
    courses = [course for course in model.courses if course.name in loop.adapt]
    actions = {action for course in courses for action in course.choose}
    yield from loop.rates
    yield from (metric.variable for metric in _outputs(model.metrics) if metric.name in loop.analyse)
    yield from (weight.variable for weight in _outputs(model.actions) if weight.name in actions)
    yield from (variable for course in courses for variable in course.filtered_weights.values())
    yield from (course.variable for course in courses if course.variable)
    yield from (parameter.variable for parameter in model.parameters if parameter.name in loop.adapt)


def _outputs(stage: StageModel | None) -> tuple[OutputModel, ...]:
    return () if stage is None else stage.outputs


class SelfDependence:
    """Counts how often each result of one loop has changed in a row. Callers hold the loop's lock."""

    def __init__(self, fed_back: frozenset[str]) -> None:
        """Begin to count.

        Args:
            fed_back: the inputs that can change because of the loop's results.
        """
        self._fed_back = fed_back
        self._change_counts = Counter[str]()
        self._changed_inputs = set[str]()
        self._causes = frozenset[str]()
        self._last_analysis_s = -math.inf
        self._reported_names = frozenset[str]()

    def note_input(self, name: str) -> None:
        """Note the change of an input, which triggers an analysis."""
        self._changed_inputs.add(name)

    def must_pause(self, now_s: float) -> bool:
        """Return whether the changed inputs must wait for the next period, because results change without an end.

        A change that the results cannot cause is analysed at once, except at the instant of the last analysis.
        """
        is_own = now_s == self._last_analysis_s or self._changed_inputs <= self._fed_back
        return is_own and bool(self._unsettled_names())

    def begin_analysis(self) -> None:
        """Note the begin of an analysis; it reads all changed inputs."""
        self._causes, self._changed_inputs = frozenset(self._changed_inputs), set()

    def end_analysis(self, changed_names: Collection[str], now_s: float) -> list[str]:
        """Count the results that an analysis has changed; return the results that depend on themselves.

        A result is returned only once. It can be returned again after an analysis that changes nothing.
        """
        is_own = now_s == self._last_analysis_s or (bool(self._causes) and self._causes <= self._fed_back)
        self._last_analysis_s = now_s
        if not changed_names:
            self._change_counts.clear()
        elif is_own:
            self._change_counts.update(changed_names)
        elif not self._unsettled_names():
            self._change_counts = Counter(changed_names)
        names, reported_names = self._unsettled_names(), self._reported_names
        self._reported_names = names
        return sorted(names - reported_names)

    def _unsettled_names(self) -> frozenset[str]:
        return frozenset(name for name, count in self._change_counts.items() if count >= MAX_CHANGES_IN_A_ROW)
