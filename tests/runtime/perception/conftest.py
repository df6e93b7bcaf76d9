"""A clock of real time for the tests of this folder."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from codra_dsl.runtime import WallClock


@pytest.fixture
def clock() -> Iterator[WallClock]:
    with WallClock() as made:
        yield made
