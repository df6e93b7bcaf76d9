"""The answer to the question what the loops bring that a rule does not, computed from intervals."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

from codra_papers.experiments.campaign.cells import interval
from codra_papers.experiments.studies.store_managers.comparing import MeasureComparison
from codra_papers.experiments.studies.store_managers.managers import OURS, OURS_TUNED, SPEED_ONLY, THRESHOLD

LOOPS, RULES = (OURS.name, OURS_TUNED), (SPEED_ONLY.name, THRESHOLD)
"""The managers with the spec's loops, and the managers whose rules they are compared with."""


def answers(table: Sequence[MeasureComparison]) -> Iterator[str]:
    """Yield a sentence for each manager of `LOOPS` and each of `RULES`.

    An advantage or a disadvantage is clear if the interval of the paired difference does not contain zero.
    """
    for rule, loops in product(RULES, LOOPS):
        yield _answer(loops, rule, [row for row in table if row.manager == loops])


def _answer(loops: str, rule: str, rows: Sequence[MeasureComparison]) -> str:
    better: list[str] = []
    worse: list[str] = []
    unclear: list[str] = []
    for row in rows:
        difference, is_more_better = row.differences[rule], row.measure.is_more_better
        name = row.measure.name.lower()
        if not (difference.is_positive or difference.is_negative):
            unclear.append(name)
        elif is_more_better is not None:
            results = better if difference.is_positive is is_more_better else worse
            results.append(f"{name} {interval(difference, 2)}")
    parts = [f"an advantage in {', '.join(better)}" if better else "no clear advantage"]
    parts += [f"a disadvantage in {', '.join(worse)}" if worse else "no clear disadvantage"]
    parts += [f"no clear difference in {', '.join(unclear)}"] if unclear else []
    return f"Compared with {rule!r}, {loops!r} brings, in an hour: {'; '.join(parts)}."
