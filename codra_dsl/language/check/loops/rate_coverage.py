"""Checks of loops (phase 5): the history of a variable covers enough time for the rates that loops compute from it.

A rate is known only while readings span half of `over`. The readings of a variable that is written every 0.5 s, and
keeps 100 readings, span 49.5 s; a rate over 2 min is never known. A held bool is true only if readings span all of
`for`. Periods that no writer states are not guessed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import OBSERVER, FaultyElements, SpecIndex
from codra_dsl.language.diagnostics import Diagnostic, Place, Related
from codra_dsl.language.model import DEFAULT_PERIOD_S, RateKind, Refresh, Variable

MIN_SPAN_SHARE = 0.5
"""The smallest share of `over` that readings must span; the same as in `codra_dsl.runtime.loops.rates`."""

_ROUNDING = 1e-9

_NEEDY_TEXTS = {
    RateKind.RATE: "known: a rate over",
    RateKind.SHARE: "known: a share over",
    RateKind.HELD: "true: a bool that is held for",
}


class _Writing(NamedTuple):
    """What writes a variable periodically, and where this is stated."""

    period_s: float
    text: str
    place: Place


def uncovered_rates(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """The readings that are kept for a rate or a share can span half of `over`, and for a held bool all of `for`."""
    for variable in spec_index.spec.context:
        base = None if variable.rate is None else spec_index.variables.get(variable.rate.of.name)
        if variable.rate is None or base is None or not _is_checkable(spec_index, faults, variable, base):
            continue
        writings = _periodic_writings(spec_index, base)
        if not writings:
            continue
        writing = min(writings, key=lambda one: one.period_s)
        period_s = writing.period_s
        over_s, is_rate, key = variable.rate.over_s, variable.rate.kind is RateKind.RATE, variable.rate.duration_key
        # A bool counts until its next reading.
        span_s = (base.history - (1 if is_rate else 0)) * period_s
        min_span_s = over_s * (1.0 if variable.rate.kind is RateKind.HELD else MIN_SPAN_SHARE)
        is_every_writer_periodic = len(writings) == len(base.sources or (OBSERVER,))
        if span_s < min_span_s - _ROUNDING:
            problem = f"'{base.name}' keeps {base.history} readings, which span {span_s:g} s"
            help = f"write 'history: {math.ceil(over_s / period_s) + 1}' in '{base.name}', or a shorter '{key}'"
        elif is_rate and period_s > over_s + _ROUNDING and is_every_writer_periodic:
            problem = f"there is at most one reading in {over_s:g} s"
            help = f"write an 'over' of at least {2 * period_s:g} s"
        else:
            continue
        yield finding(
            "uncovered-rate",
            f"context-variable '{variable.name}' is never {_NEEDY_TEXTS[variable.rate.kind]} {over_s:g} s needs "
            f"readings that span {min_span_s:g} s, but {problem}",
            variable.places.get(key, variable.place),
            path=f"context.{variable.name}.{key}",
            help=help,
            related=(
                Related(f"'{base.name}' keeps its readings", base.places.get("history", base.place)),
                Related(f"{writing.text} every {period_s:g} s", writing.place),
            ),
        )


def _is_checkable(spec_index: SpecIndex, faults: FaultyElements, variable: Variable, base: Variable) -> bool:
    return (
        faults.is_sound("context", variable.name)
        and faults.is_sound("context", base.name)
        and spec_index.is_readable("context", variable.name, "over", "for")
        and spec_index.is_readable("context", base.name, "history", "source")
        and not spec_index.has_damage("observers", "identifies", "period")
    )


def _periodic_writings(spec_index: SpecIndex, variable: Variable) -> list[_Writing]:
    """Return what writes a variable periodically. An observer of a variable with `refresh: on_event` does not."""
    source_names = {source.name for source in variable.sources}
    writings = [
        _Writing(agent.period_s, f"agent '{agent.name}' writes it", agent.conduct.places.get("period", agent.place))
        for agent in spec_index.spec.agents
        if agent.name in source_names and agent.period_s is not None
    ]
    algorithms = [spec_index.algorithms[name] for name in spec_index.producers.get(variable.name, ())]
    if algorithms and variable.refresh is Refresh.PERIODIC:
        period_s = (
            spec_index.claims[variable.name][0].period_s if variable.name in spec_index.claims else DEFAULT_PERIOD_S
        )
        algorithm = min(algorithms, key=lambda candidate: candidate.min_interval_s)
        text = f"algorithm '{algorithm.name}' identifies it at most"
        writings.append(_Writing(max(period_s, algorithm.min_interval_s), text, algorithm.place))
    return writings


RATE_CHECKS = (uncovered_rates,)
"""The checks of this module."""
