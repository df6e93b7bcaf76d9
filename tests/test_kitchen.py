"""specs/kitchen.yaml is a spec as a user writes it; kitchen.timeline.yaml describes its behaviour."""

from __future__ import annotations

from pathlib import Path


def test_the_perception_functions_take_at_most_thirty_lines() -> None:
    text = (Path(__file__).parents[1] / "examples" / "kitchen" / "perception.py").read_text("utf-8")

    assert len([line for line in text.splitlines() if line.strip()]) <= 30
