"""Deriving the events of a run anew from its journal, and comparing them with it."""

from __future__ import annotations

from codra_dsl.runtime.replay.comparison import Difference, Replayed
from codra_dsl.runtime.replay.playing import Build, knowledge_at, replay

__all__ = ["Build", "Difference", "Replayed", "knowledge_at", "replay"]
