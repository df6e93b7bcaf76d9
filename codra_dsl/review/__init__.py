"""Review: two versions of some specs -> what that means for a robot and its programs. Pure; git is not its business."""

from codra_dsl.review.changes import Category, Change, Latency, Level, Review, Verdict
from codra_dsl.review.specs import review
from codra_dsl.review.version import Broken, Version

__all__ = ["Broken", "Category", "Change", "Latency", "Level", "Review", "Verdict", "Version", "review"]
