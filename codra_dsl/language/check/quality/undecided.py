"""The finding about conditions that need more work than the budget of a spec allows."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.language.check.conditions.conditions import Site
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import SpecIndex
from codra_dsl.language.check.solver.budget import WORK_PER_CONDITION, WORK_PER_SPEC, Budget
from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.language.expression import walk


def budget_of(spec_index: SpecIndex) -> Budget:
    """Return the budget for the analysis of the conditions of a spec."""
    return Budget(WORK_PER_SPEC + WORK_PER_CONDITION * len(spec_index.sites))


def undecided_conditions(spec_index: SpecIndex, budget: Budget) -> Iterator[Diagnostic]:
    """All questions about the conditions of the spec were decided within the budget."""
    if not budget.has_undecided:
        return
    site = _costliest_site(spec_index, budget)
    yield finding(
        "undecided-conditions",
        "the conditions of this spec need too much analysis: it was not decided whether each can be true and false"
        + ("" if site is None else f"; most work was spent on '{site.condition.text}'"),
        spec_index.spec.place if site is None else site.condition.place,
        path="" if site is None else site.path,
        help="simplify the condition: mention each name less often, shorten lists after 'in', "
        "write numbers with fewer digits, or compute a part of it in the perception function",
    )


def _costliest_site(spec_index: SpecIndex, budget: Budget) -> Site | None:
    """Return the first condition that belongs to the question that needed most work."""
    costliest_parts = {id(part) for condition in budget.costliest_conditions for part in walk(condition)}
    for site in spec_index.sites:
        tree = site.condition.tree
        if tree is not None and any(id(part) in costliest_parts for part in walk(tree)):
            return site
    return None
