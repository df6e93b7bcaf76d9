"""Rules of phase 5: misleading context, and unused context. `docs/reference/context-quality.md` defines the rules.

A rule reports a defect only if the defect certainly follows from the spec. If the spec can be understood in two ways,
the rule reports nothing.
"""

from codra_dsl.language.check.quality.conditions import CONDITION_CHECKS
from codra_dsl.language.check.quality.decisions import DECISION_CHECKS
from codra_dsl.language.check.quality.previews import PREVIEW_CHECKS
from codra_dsl.language.check.quality.times import TIMING_CHECKS
from codra_dsl.language.check.quality.trust import TRUST_CHECKS
from codra_dsl.language.check.quality.unused import UNUSED_CHECKS

QUALITY_CHECKS = (*TRUST_CHECKS, *CONDITION_CHECKS, *DECISION_CHECKS, *PREVIEW_CHECKS, *TIMING_CHECKS, *UNUSED_CHECKS)
"""The rules of this phase."""

__all__ = ["QUALITY_CHECKS"]
