"""Phase 6: what the language has and the runtime does not act on yet, said plainly."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.check.rules import finding
from codra_dsl.check.scope import Faults, Scope
from codra_dsl.diagnostics import Diagnostic
from codra_dsl.model import Algorithm, Expected, Hysteresis, Refresh


def confirmations(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """`confirm` does not count results yet."""
    for algorithm in _sound_algorithms(scope, faults):
        for entry in algorithm.identifies:
            name = entry.variable.name
            readable = scope.readable("perception", algorithm.name, f"identifies.{name}")
            if isinstance(entry.by, Hysteresis) and entry.by.confirm is not None and readable:
                yield finding(
                    "not-yet-confirmed",
                    f"'confirm' of '{name}' has no effect yet: each result counts at once",
                    entry.by.place,
                    path=f"perception.{algorithm.name}.identifies.{name}",
                    way_out="refuse doubtful results in 'accept_when'",
                )


def hystereses(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """Between `enter` and `leave` the value is not held yet."""
    for algorithm in _sound_algorithms(scope, faults):
        for entry in algorithm.identifies:
            name = entry.variable.name
            readable = scope.readable("perception", algorithm.name, f"identifies.{name}")
            if isinstance(entry.by, Hysteresis) and entry.by.leave is not None and readable:
                yield finding(
                    "not-yet-between",
                    f"between 'enter' and 'leave' of '{name}' a result is unknown for now, and so rejected",
                    entry.by.place,
                    path=f"perception.{algorithm.name}.identifies.{name}",
                    way_out=f"with 'when_unobservable: keep' on '{name}' the last value stays",
                )


def expectations(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """What a skill expects is not judged yet."""
    for skill in scope.spec.skills:
        sound = faults.sound("skills", skill.name) and scope.readable("skills", skill.name, "monitor")
        for expectation in skill.monitor:
            if expectation.expected is not Expected.WATCHED and sound:
                name = expectation.variable.name
                yield finding(
                    "not-yet-expected",
                    f"'{name} {expectation.expected} ...' in skill '{skill.name}' is watched, "
                    "but nothing judges yet whether it comes true",
                    expectation.place,
                    path=f"skills.{skill.name}.monitor.{name}",
                    way_out=f"decide on '{name}' after acting, with 'since_s' and 'wait_up_to_s'",
                )


def refreshes(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """`on_event` looks periodically for now."""
    for variable in scope.spec.context:
        if variable.refresh is Refresh.ON_EVENT and faults.sound("context", variable.name):
            yield finding(
                "not-yet-on-event",
                f"'refresh: on_event' of '{variable.name}' has no effect yet: it is looked at periodically",
                variable.places.get("refresh", variable.place),
                path=f"context.{variable.name}.refresh",
                way_out="set the 'period' of its observer to what you can afford",
            )


EFFECTS = (confirmations, hystereses, expectations, refreshes)
"""The rules of this phase."""


def _sound_algorithms(scope: Scope, faults: Faults) -> Iterator[Algorithm]:
    return (each for each in scope.spec.perception if faults.sound("perception", each.name))
