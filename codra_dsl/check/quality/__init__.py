"""Phase 5: context that would mislead, and context that nobody asks for; `docs/reference/context-quality.md` says when.

Each rule speaks where a defect is certain under what the spec says, and keeps quiet where two readings are possible.
"""

from codra_dsl.check.quality.conditions import CONDITIONS
from codra_dsl.check.quality.decisions import DECISIONS
from codra_dsl.check.quality.leftovers import LEFTOVERS
from codra_dsl.check.quality.times import TIMES
from codra_dsl.check.quality.trust import TRUST

QUALITY = (*TRUST, *CONDITIONS, *DECISIONS, *TIMES, *LEFTOVERS)
"""The rules of this phase."""

__all__ = ["QUALITY"]
