"""Eight threads use one context manager at random; `make crowd` runs ten thousand operations, three times."""

from __future__ import annotations

import random

import pytest

from codra_dsl.runtime import WallClock
from codra_dsl.runtime.observers import forest as forest_module
from tests.campaigns.crowd.__main__ import print_figures
from tests.campaigns.crowd.crowd import Crowd
from tests.runtime.observers.test_activation import MissesOneDecrement


@pytest.mark.parametrize("seed", [1, 2])
def test_eight_threads_do_not_hang_lose_a_wake_up_or_leave_an_observer_running_or_missing(seed: int) -> None:
    figures = print_figures(seed, Crowd(seed, 1200).run())

    assert figures.mistakes == []
    assert figures.lives >= 2
    assert min(figures.judged, figures.most_running, figures.jobs / 10, figures.done["wait for mail"] / 10) >= 5


def test_an_observer_that_is_left_running_is_detected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(forest_module, "Activation", MissesOneDecrement)

    assert any("left running" in mistake for mistake in Crowd(1, 1200).run().mistakes)


def test_a_lost_wake_up_is_detected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(WallClock, "notify", lambda _: None)
    crowd = Crowd(1, 0, patience_s=2.0)

    with crowd.clock, crowd.life.manager, pytest.raises(AssertionError, match="was not woken when its value arrived"):
        crowd._judge_silence(crowd.life.manager, random.Random(1))
