"""Checks: Spec -> (CheckedSpec | None, diagnostics). Only this room makes a `CheckedSpec`."""

from codra_dsl.check.checked import CheckedAlgorithm, CheckedCondition, CheckedSpec
from codra_dsl.check.phases import PHASES, check
from codra_dsl.check.rules import RULES

__all__ = ["PHASES", "RULES", "CheckedAlgorithm", "CheckedCondition", "CheckedSpec", "check"]
