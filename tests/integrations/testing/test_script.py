from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from codra_dsl.integrations.testing.script import Script
from codra_dsl.integrations.testing.timeline import Behaviour, Fault
from codra_dsl.language.diagnostics import Place, Span
from codra_dsl.runtime import SimClock
from codra_dsl.runtime.clock import Work
from codra_dsl.runtime.values.model import Algorithm

PLACE = Place(Span("case.yaml", 1, 1, 1, 1))


class Counter:
    """A perception class that counts its calls."""

    def __init__(self) -> None:
        self.count = 0

    def perceive(self, *, job: Any) -> dict[str, object]:
        self.count += 1
        return {"count": self.count, "at_s": job.now_s()}


def run_in_job(perceive: Callable[..., object]) -> object:
    results: list[object] = []
    clock = SimClock()

    def run(work: Work) -> object:
        return perceive(job=work)

    clock.start(run, results.append)
    clock.sleep(10.0)
    return results[0]


def test_a_class_of_the_user_keeps_its_state_when_one_of_its_jobs_fails() -> None:
    script = Script((), ())
    function = script.function_for(Algorithm(name="count", call="tests.integrations.testing.test_script:Counter"))
    assert isinstance(function, type)
    counter = function()

    assert run_in_job(counter.perceive) == {"count": 1, "at_s": 0.0}
    script.change(Behaviour(algorithm="count", place=PLACE, fault=Fault(raises="no frame", jobs=1)))
    with pytest.raises(RuntimeError, match="no frame"):
        run_in_job(counter.perceive)

    assert run_in_job(counter.perceive) == {"count": 2, "at_s": 0.0}
