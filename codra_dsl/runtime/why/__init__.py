"""Explain a variable: the chain from its value to the evidence, or from the unknown value to the missing conditions."""

from __future__ import annotations

from codra_dsl.runtime.why.explanation import PREVIEW_PREFIX, LatestEventsAt, explain
from codra_dsl.runtime.why.values import Condition, Look, MissingChange, Way, Why

__all__ = ["PREVIEW_PREFIX", "Condition", "LatestEventsAt", "Look", "MissingChange", "Way", "Why", "explain"]
