"""Rules of phase 5: misleading context, and unused context. `docs/reference/context-quality.md` defines the rules.

A rule reports a defect only if the defect certainly follows from the spec. If the spec can be understood in two ways,
the rule reports nothing.
"""

from codra_dsl.language.check.quality.conditions import CONDITIONS
from codra_dsl.language.check.quality.decisions import DECISIONS
from codra_dsl.language.check.quality.times import TIMES
from codra_dsl.language.check.quality.trust import TRUST
from codra_dsl.language.check.quality.unused import UNUSED

QUALITY = (*TRUST, *CONDITIONS, *DECISIONS, *TIMES, *UNUSED)
"""The rules of this phase."""

__all__ = ["QUALITY"]
