"""Replay a run from its journal: derive its events again, and compare them with the recorded ones."""

from __future__ import annotations

from codra_dsl.runtime.replay.comparison import Difference, Replayed
from codra_dsl.runtime.replay.decision_counts import DecisionCounts
from codra_dsl.runtime.replay.player import Build
from codra_dsl.runtime.replay.replaying import knowledge_at, replay

__all__ = ["Build", "DecisionCounts", "Difference", "Replayed", "knowledge_at", "replay"]
