"""The review of all specs: specs in both versions, added and removed specs, and specs with errors."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import chain

from codra_dsl.generation.build_plan import BuildPlan
from codra_dsl.language.diagnostics import Diagnostic, Place, Span, suggest
from codra_dsl.language.model import Spec
from codra_dsl.tooling.diff.changes import Category, Change, Latency, Review, sort_changes
from codra_dsl.tooling.diff.observers import compare_layout
from codra_dsl.tooling.diff.table import FIELD_COMPARERS, KIND_BY_SECTION
from codra_dsl.tooling.diff.version import BrokenSpec, Pair, Version, make_pair
from codra_dsl.tooling.diff.walk import Scope, removal_message

_CATEGORY_OF_CODE = {"CDR5101": Category.CYCLIC, "CDR5102": Category.UNOBSERVABLE}


def review(before: Version, after: Version) -> Review:
    """Return the effects on a robot of the changes between two versions of some specs."""
    changes: list[Change] = []
    latencies: list[Latency] = []
    old_plans, new_plans = ({plan.name: plan for plan in version.plans} for version in (before, after))
    for name, old_plan in old_plans.items():
        if name in new_plans:
            pair = make_pair(old_plan, new_plans[name])
            changes += _compare_spec(pair)
            latencies += _latencies(pair)
        elif _find_broken_spec(name, old_plan.checked.spec.file, after.broken_specs) is None:
            similar_name = suggest(name, sorted(new_plans.keys() - old_plans.keys()))
            changes.append(_removal(name, old_plan.checked.spec.place, similar_name))
    for broken_spec in after.broken_specs:
        changes += _error_changes(broken_spec)
    for broken_spec in before.broken_specs:
        if broken_spec.name not in old_plans:
            changes += _repair_or_removal(broken_spec, after)
    for name, new_plan in new_plans.items():
        if name not in old_plans and not any(
            _is_same_spec(broken_spec, new_plan) for broken_spec in before.broken_specs
        ):
            place = new_plan.checked.spec.place
            changes.append(Change(category=Category.ADDED, element=name, message="new spec", new_place=place))
    return Review(
        changes=sort_changes(changes), latencies=tuple(sorted(latencies, key=lambda latency: latency.element))
    )


def _compare_spec(pair: Pair) -> Iterator[Change]:
    specs = pair.old.spec, pair.new.spec
    scope = Scope(pair=pair, comparer_table=FIELD_COMPARERS, id=pair.new.spec.name, elements=specs, values=specs)
    for change in (*scope.changes(), *compare_layout(scope)):
        old_place, new_place = (
            _place_at_site(change, place, spec)
            for place, spec in zip((change.old_place, change.new_place), specs, strict=True)
        )
        yield replace(change, old_place=old_place, new_place=new_place)


def _place_at_site(change: Change, place: Place | None, spec: Spec) -> Place | None:
    """Return the place of the site's value that a change concerns; the place in the spec if there is no such value.

    A value that is merged into a mapping, such as a coordinate of a pose, is reported at the mapping of the spec. An
    argument of a use concerns the values that contain its parameter, unless the site has a value of its own.
    """
    site = spec.site
    if site is None or place is None or place.span.file == site.file:
        return place
    kind, _, name = change.element.partition("/")[2].rpartition("/")
    own_values = (
        value
        for value in site.replacements_of.get(name, ())
        if kind == KIND_BY_SECTION.get(value.section) and _is_inside(change.key, value.key)
    )
    arguments = spec.site_arguments(place) if change.key else ()
    return next((value.place for value in (*own_values, *arguments)), place)


def _is_inside(key: str, other_key: str) -> bool:
    """Return whether one of two keys is the other key or a part of its value."""
    return f"{key}.".startswith(f"{other_key}.") or f"{other_key}.".startswith(f"{key}.")


def _latencies(pair: Pair) -> Iterator[Latency]:
    for name, before_s in pair.old.worst_latencies_s.items():
        after_s = pair.new.worst_latencies_s.get(name)
        if after_s is not None and after_s != before_s:
            yield Latency(element=pair.element_id("context", name), before_s=before_s, after_s=after_s)


def _removal(name: str, place: Place | None, similar_name: str | None = None) -> Change:
    return Change(
        category=Category.REMOVED, element=name, message=removal_message("spec", similar_name), old_place=place
    )


def _error_changes(broken_spec: BrokenSpec) -> Iterator[Change]:
    for error in broken_spec.errors:
        category = _CATEGORY_OF_CODE.get(error.code, Category.INVALID)
        message = f"{error.message} [{error.code}]"
        yield Change(
            category=category, element=_element_of_error(broken_spec, error), message=message, new_place=error.place
        )


def _element_of_error(broken_spec: BrokenSpec, error: Diagnostic) -> str:
    spec = broken_spec.name or broken_spec.file
    section, _, element_path = error.path.removeprefix("knowledge.").partition(".")
    return (
        f"{spec}/{KIND_BY_SECTION[section]}/{element_path.partition('.')[0]}"
        if section in KIND_BY_SECTION and element_path
        else spec
    )


def _repair_or_removal(broken_spec: BrokenSpec, after: Version) -> Iterator[Change]:
    """Yield a change if a spec with errors in A is repaired or removed. If the spec has errors in B, yield nothing."""
    plan = next((plan for plan in after.plans if _is_same_spec(broken_spec, plan)), None)
    if plan is not None:
        message = "the spec had errors and is valid now, so it cannot be compared with the earlier version"
        old_place, new_place = broken_spec.errors[0].place, plan.checked.spec.place
        yield Change(
            category=Category.REPAIRED, element=plan.name, message=message, old_place=old_place, new_place=new_place
        )
    elif _find_broken_spec(broken_spec.name, broken_spec.file, after.broken_specs) is None:
        yield _removal(broken_spec.name or broken_spec.file, Place(Span(broken_spec.file, 1, 1, 1, 1)))


def _is_same_spec(broken_spec: BrokenSpec, plan: BuildPlan) -> bool:
    return plan.name == broken_spec.name or (broken_spec.name is None and plan.checked.spec.file == broken_spec.file)


def _find_broken_spec(name: str | None, file: str, broken_specs: Iterable[BrokenSpec]) -> BrokenSpec | None:
    """Return the spec with errors that has this name, or else this file; None if there is none.

    The file decides only if the name of the spec with errors is unknown or `name` is None.
    """
    named_specs = (broken_spec for broken_spec in broken_specs if name is not None and broken_spec.name == name)
    nameless_specs = (
        broken_spec
        for broken_spec in broken_specs
        if broken_spec.file == file and (broken_spec.name is None or name is None)
    )
    return next(chain(named_specs, nameless_specs), None)
