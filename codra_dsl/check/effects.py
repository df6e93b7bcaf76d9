"""Phase 6: what the language has and the runtime does not act on yet, said plainly."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.check.rules import finding
from codra_dsl.check.scope import Faults, Scope
from codra_dsl.diagnostics import Diagnostic
from codra_dsl.model import Algorithm, Isolation


def isolations(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """`process` runs in a thread for now."""
    for algorithm in _sound_algorithms(scope, faults):
        if algorithm.isolate is Isolation.PROCESS:
            yield finding(
                "not-yet-isolated",
                f"'isolate: process' of algorithm '{algorithm.name}' has no effect yet: it runs in a thread",
                algorithm.places.get("isolate", algorithm.place),
                path=f"perception.{algorithm.name}.isolate",
                way_out="let the function itself start a process if it may crash or block Python",
            )


EFFECTS = (isolations,)
"""The rules of this phase."""


def _sound_algorithms(scope: Scope, faults: Faults) -> Iterator[Algorithm]:
    return (each for each in scope.spec.perception if faults.sound("perception", each.name))
