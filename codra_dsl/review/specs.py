"""What became of whole specs: pairs by name, those that came and went, those with errors."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain

from codra_dsl.build_plan import BuildPlan
from codra_dsl.diagnostics import Diagnostic, Place, Span, suggest
from codra_dsl.review.algorithms import algorithm_changes
from codra_dsl.review.changes import Category, Change, Latency, Review, in_order
from codra_dsl.review.knowledge import knowledge_changes
from codra_dsl.review.loops import loop_changes
from codra_dsl.review.observers import layout_changes, observer_changes, resource_changes
from codra_dsl.review.skills import skill_changes
from codra_dsl.review.variables import variable_changes
from codra_dsl.review.version import Broken, Pair, Version, paired

_KINDS = {"skills": "skill", "observers": "observer", "resources": "resource", "agents": "agent"} | {
    "types": "type",
    "nodes": "node",
    "edges": "edge",
    "tasks": "task",
    "metrics": "metric",
    "actions": "action",
    "adaptation": "adaptation",
    "trees": "tree",
    "loops": "loop",
}
_BY_CODE = {"CDR5101": Category.CYCLIC, "CDR5102": Category.UNOBSERVABLE}


def review(before: Version, after: Version) -> Review:
    """Return what it means that one version of some specs becomes another."""
    changes: list[Change] = []
    latencies: list[Latency] = []
    now = {plan.name: plan for plan in after.plans}
    for old in before.plans:
        if old.name in now:
            pair = paired(old, now[old.name])
            changes += _compared(pair)
            latencies += _latencies(pair)
        elif _broken(old.name, old.checked.spec.file, after.broken) is None:
            changes.append(_gone(old.name, old.checked.spec.place, sorted(set(now) - _names(before))))
    changes += (change for broken in after.broken for change in _errors(broken))
    changes += _of_broken(before, after)
    changes += _new(before, after)
    return Review(changes=in_order(changes), latencies=tuple(sorted(latencies, key=lambda each: each.element)))


def _compared(pair: Pair) -> Iterator[Change]:
    yield from variable_changes(pair)
    yield from algorithm_changes(pair)
    yield from skill_changes(pair)
    yield from observer_changes(pair)
    yield from resource_changes(pair)
    yield from layout_changes(pair)
    yield from knowledge_changes(pair)
    yield from loop_changes(pair)


def _latencies(pair: Pair) -> Iterator[Latency]:
    for name, before_s in pair.old.worst_s.items():
        after_s = pair.new.worst_s.get(name)
        if after_s is not None and after_s != before_s:
            yield Latency(element=pair.new.id("context", name), before_s=before_s, after_s=after_s)


def _gone(name: str, place: Place | None, others: list[str]) -> Change:
    near = suggest(name, others)
    hint = "" if near is None else f"; '{near}' looks like its new name"
    return Change(category=Category.REMOVED, element=name, message=f"the spec is gone{hint}", before=place)


def _errors(broken: Broken) -> Iterator[Change]:
    for found in broken.errors:
        yield Change(
            category=_BY_CODE.get(found.code, Category.INVALID),
            element=_element(broken, found),
            message=f"{found.message} [{found.code}]",
            after=found.place,
        )


def _element(broken: Broken, found: Diagnostic) -> str:
    spec = broken.name or broken.file
    section, _, rest = found.path.removeprefix("knowledge.").partition(".")
    if section not in ("context", "perception", *_KINDS) or not rest:
        return spec
    return f"{spec}/{_KINDS.get(section, section)}/{rest.partition('.')[0]}"


def _of_broken(before: Version, after: Version) -> Iterator[Change]:
    """Yield what became of specs that had errors in A: repaired, gone, or still with errors, which is told there."""
    planned = _names(before)
    for old in (each for each in before.broken if each.name not in planned):
        plan = next((each for each in after.plans if _is_of(old, each)), None)
        if plan is not None:
            message = "it had errors and has none now: there is nothing to compare with"
            place = plan.checked.spec.place
            yield Change(
                category=Category.REPAIRED, element=plan.name, message=message, before=old.errors[0].place, after=place
            )
        elif _broken(old.name, old.file, after.broken) is None:
            yield _gone(old.name or old.file, Place(Span(old.file, 1, 1, 1, 1)), [])


def _new(before: Version, after: Version) -> Iterator[Change]:
    known = {plan.name for plan in before.plans}
    for plan in after.plans:
        if plan.name not in known and not any(_is_of(old, plan) for old in before.broken):
            yield Change(category=Category.ADDED, element=plan.name, message="new spec", after=plan.checked.spec.place)


def _is_of(broken: Broken, plan: BuildPlan) -> bool:
    return plan.name == broken.name or (broken.name is None and plan.checked.spec.file == broken.file)


def _broken(name: str | None, file: str, among: Iterable[Broken]) -> Broken | None:
    """Return the spec with errors that a spec has become: the one of its name, else the nameless one in its file."""
    named = (each for each in among if name is not None and each.name == name)
    nameless = (each for each in among if each.file == file and (each.name is None or name is None))
    return next(chain(named, nameless), None)


def _names(version: Version) -> set[str]:
    return {plan.name for plan in version.plans}
