"""Review of two versions of some specs: the effects of the changes on a robot and its programs."""

from codra_dsl.tooling.diff.changes import Category, Change, Latency, Level, Review, Verdict
from codra_dsl.tooling.diff.specs import review
from codra_dsl.tooling.diff.version import BrokenSpec, Version

__all__ = ["BrokenSpec", "Category", "Change", "Latency", "Level", "Review", "Verdict", "Version", "review"]
