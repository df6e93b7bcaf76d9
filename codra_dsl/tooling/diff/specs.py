"""The review of all specs: specs in both versions, added and removed specs, and specs with errors."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain

from codra_dsl.generation.build_plan import BuildPlan
from codra_dsl.language.diagnostics import Diagnostic, Place, Span, suggest
from codra_dsl.tooling.diff.changes import Category, Change, Latency, Review, in_order
from codra_dsl.tooling.diff.observers import compare_layout
from codra_dsl.tooling.diff.table import FIELDS, KINDS
from codra_dsl.tooling.diff.version import BrokenSpec, Pair, Version, make_pair
from codra_dsl.tooling.diff.walk import Scope, removal_message

_CATEGORY_OF_CODE = {"CDR5101": Category.CYCLIC, "CDR5102": Category.UNOBSERVABLE}


def review(before: Version, after: Version) -> Review:
    """Return what the changes between two versions of some specs mean for a robot."""
    changes: list[Change] = []
    latencies: list[Latency] = []
    old_plans, new_plans = ({plan.name: plan for plan in version.plans} for version in (before, after))
    for name, old in old_plans.items():
        if name in new_plans:
            pair = make_pair(old, new_plans[name])
            changes += _compare_spec(pair)
            latencies += _latencies(pair)
        elif _find_broken_spec(name, old.checked.spec.file, after.broken) is None:
            similar_name = suggest(name, sorted(new_plans.keys() - old_plans.keys()))
            changes.append(_removal(name, old.checked.spec.place, similar_name))
    for broken in after.broken:
        changes += _error_changes(broken)
    for broken in before.broken:
        if broken.name not in old_plans:
            changes += _repair_or_removal(broken, after)
    for name, new in new_plans.items():
        if name not in old_plans and not any(_is_of(broken, new) for broken in before.broken):
            place = new.checked.spec.place
            changes.append(Change(category=Category.ADDED, element=name, message="new spec", after=place))
    return Review(changes=in_order(changes), latencies=tuple(sorted(latencies, key=lambda latency: latency.element)))


def _compare_spec(pair: Pair) -> Iterator[Change]:
    specs = pair.old.spec, pair.new.spec
    scope = Scope(pair=pair, table=FIELDS, id=pair.new.spec.name, elements=specs, values=specs)
    yield from scope.changes()
    yield from compare_layout(scope)


def _latencies(pair: Pair) -> Iterator[Latency]:
    for name, before_s in pair.old.worst_s.items():
        after_s = pair.new.worst_s.get(name)
        if after_s is not None and after_s != before_s:
            yield Latency(element=pair.element_id("context", name), before_s=before_s, after_s=after_s)


def _removal(name: str, place: Place | None, similar_name: str | None = None) -> Change:
    return Change(category=Category.REMOVED, element=name, message=removal_message("spec", similar_name), before=place)


def _error_changes(broken: BrokenSpec) -> Iterator[Change]:
    for error in broken.errors:
        category = _CATEGORY_OF_CODE.get(error.code, Category.INVALID)
        message = f"{error.message} [{error.code}]"
        yield Change(category=category, element=_element_of_error(broken, error), message=message, after=error.place)


def _element_of_error(broken: BrokenSpec, error: Diagnostic) -> str:
    spec = broken.name or broken.file
    section, _, rest = error.path.removeprefix("knowledge.").partition(".")
    return f"{spec}/{KINDS[section]}/{rest.partition('.')[0]}" if section in KINDS and rest else spec


def _repair_or_removal(broken: BrokenSpec, after: Version) -> Iterator[Change]:
    """Yield a change if a spec with errors in A is repaired or removed. If it has errors in B, these are reported."""
    plan = next((plan for plan in after.plans if _is_of(broken, plan)), None)
    if plan is not None:
        message = "the spec had errors and is valid now: there is no earlier version to compare with"
        before, now = broken.errors[0].place, plan.checked.spec.place
        yield Change(category=Category.REPAIRED, element=plan.name, message=message, before=before, after=now)
    elif _find_broken_spec(broken.name, broken.file, after.broken) is None:
        yield _removal(broken.name or broken.file, Place(Span(broken.file, 1, 1, 1, 1)))


def _is_of(broken: BrokenSpec, plan: BuildPlan) -> bool:
    return plan.name == broken.name or (broken.name is None and plan.checked.spec.file == broken.file)


def _find_broken_spec(name: str | None, file: str, broken_specs: Iterable[BrokenSpec]) -> BrokenSpec | None:
    """Return the spec with errors that has a name, or else, if one of the names is unknown, the one in a file."""
    named_specs = (broken for broken in broken_specs if name is not None and broken.name == name)
    nameless_specs = (
        broken for broken in broken_specs if broken.file == file and (broken.name is None or name is None)
    )
    return next(chain(named_specs, nameless_specs), None)
