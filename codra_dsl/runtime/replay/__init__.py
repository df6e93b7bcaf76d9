"""Replay a run from its journal: derive its events again, and compare them with the recorded ones."""

from __future__ import annotations

from codra_dsl.runtime.replay.comparison import Difference, Replayed
from codra_dsl.runtime.replay.player import Build, knowledge_at, replay

__all__ = ["Build", "Difference", "Replayed", "knowledge_at", "replay"]
