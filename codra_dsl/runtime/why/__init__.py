"""Why a variable is what it is: the chain from a value to its evidence, or from unknown to what is missing."""

from __future__ import annotations

from codra_dsl.runtime.why.explaining import Ledgers, explain
from codra_dsl.runtime.why.values import Condition, Look, Missing, Way, Why

__all__ = ["Condition", "Ledgers", "Look", "Missing", "Way", "Why", "explain"]
