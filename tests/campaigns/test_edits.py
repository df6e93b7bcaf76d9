"""After random edits, runs that use earlier results and runs that use none agree; `make edits` makes many more."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.campaigns.edits.comparison import Comparison
from tests.campaigns.edits.project import small_project


def test_after_random_edits_earlier_results_change_neither_findings_nor_output(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", f"{tmp_path}-user-cache")
    comparison = Comparison(small_project(), tmp_path, seed=1)

    for _ in range(12):
        comparison.step()

    assert comparison.reused_count >= comparison.result_count / 4
