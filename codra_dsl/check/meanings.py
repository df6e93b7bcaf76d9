"""Phase 3: types, units, members, and how resources are used."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.check.conditions import Site
from codra_dsl.check.fixes import member as member_fix
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import Faults, Scope
from codra_dsl.check.types import Problem
from codra_dsl.check.words import USERS
from codra_dsl.diagnostics import Diagnostic, Place, Related, suggest
from codra_dsl.expression import Text
from codra_dsl.model import Access, Algorithm, Hysteresis, Identification, Kind, Members, Usage, ValueType, Variable


def conditions(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """Every condition is one, compares what can be compared, and gives what its variable takes."""
    for judgement in scope.judgements.values():
        for problem in judgement.problems:
            yield _of_condition(scope, judgement.site, problem)


def whole_ranges(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """The range of an int ends at whole numbers."""
    for variable in scope.spec.context:
        yield from _of_range(variable.type, variable.place, "context", variable.name, "range")
    for algorithm in scope.spec.perception:
        for returned in algorithm.returns:
            key = f"returns.{returned.name}.range"
            yield from _of_range(returned.type, returned.place, "perception", algorithm.name, key)


def forms_of_identification(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """A mapping gives an enum its members; `enter` and `leave` give a bool its truth."""
    for algorithm in scope.spec.perception:
        for entry in algorithm.identifies:
            variable = scope.variables.get(entry.variable.name)
            if variable is None or scope.context_types[variable.name] is None:
                continue
            if isinstance(entry.by, Members):
                yield from _of_members(scope, algorithm, entry, entry.by, variable)
            if isinstance(entry.by, Hysteresis) and variable.type.kind is not Kind.BOOL:
                message = f"'enter' and 'leave' give true or false, but '{variable.name}' is {_a(variable)}"
                way_out = "state one condition" if variable.type.kind is not Kind.ENUM else "map members to conditions"
                yield _wrong_form(algorithm, entry.by.place, message, way_out, variable)


def commanded_resources(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """An observer is passive: it reads, and never controls hardware (P1, section 3.2)."""
    for algorithm in scope.spec.perception:
        for usage in algorithm.uses:
            if usage.access is Access.COMMAND:
                yield finding(
                    "commanded-resource",
                    f"algorithm '{algorithm.name}' commands '{usage.resource.name}', but observers are passive",
                    usage.place,
                    path=f"perception.{algorithm.name}.uses.{usage.resource.name}",
                    way_out="write 'read', and let a skill of the main execution move what has to move",
                )


def misused_resources(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """What has slots is used by slot; what has none is a handle to read."""
    for algorithm in scope.spec.perception:
        for usage in algorithm.uses:
            resource = scope.resources.get(usage.resource.name)
            if resource is None or not scope.readable("resources", resource.name, "slots"):
                continue
            if usage.access is Access.SLOT and resource.slots is None:
                message = f"algorithm '{algorithm.name}' takes a slot of resource '{resource.name}', which has none"
                way_out = f"write 'read', or declare '{resource.name}: {{slots: 1}}'"
                yield _misused(algorithm, usage, resource.place, message, way_out)
            if usage.access is Access.READ and resource.slots is not None:
                message = (
                    f"algorithm '{algorithm.name}' reads resource '{resource.name}', which has slots and no handle"
                )
                yield _misused(algorithm, usage, resource.place, message, "write 'slot'")


TYPES = (conditions, whole_ranges, forms_of_identification, commanded_resources, misused_resources)
"""The rules of this phase."""


def _of_range(declared: ValueType, place: Place, section: str, name: str, key: str) -> Iterator[Diagnostic]:
    broken = [end for end in declared.range or () if not float(end).is_integer()]
    if declared.kind is Kind.INT and broken:
        owner = "" if section == "context" else f" of '{key.split('.')[1]}'"
        message = f"the range{owner} in {USERS[section]} '{name}' ends at {broken[0]:g}, but an int is whole"
        where = declared.places.get("range", place)
        yield finding(
            "wrong-range", message, where, path=f"{section}.{name}.{key}", way_out="use whole numbers, or a float"
        )


def _of_condition(scope: Scope, site: Site, problem: Problem) -> Diagnostic:
    section, name = site.owner
    message = f"{problem.message} ('{site.role}' of {USERS[section]} '{name}')"
    place = site.condition.place_of(problem.node)
    fix = None
    if problem.meant is not None and isinstance(problem.node, Text):
        letters = site.condition.place_between(problem.node.start + 1, problem.node.end - 1)
        fix = member_fix(problem.node.value, problem.meant, problem.candidates, letters, scope.mentioned)
    return finding(problem.rule, message, place, path=site.path, way_out=problem.way_out, fix=fix)


def _of_members(
    scope: Scope, algorithm: Algorithm, entry: Identification, by: Members, variable: Variable
) -> Iterator[Diagnostic]:
    if variable.type.kind is not Kind.ENUM:
        message = f"a mapping gives an enum its members, but '{variable.name}' is {_a(variable)}"
        with_hysteresis = ", or {enter: ..., leave: ...}" if variable.type.kind is Kind.BOOL else ""
        yield _wrong_form(algorithm, by.place, message, f"state one condition{with_hysteresis}", variable)
        return
    for member, _ in by.cases:
        if member.name not in variable.type.values:
            near = suggest(member.name, variable.type.values)
            listed = ", ".join(variable.type.values[:10])
            yield finding(
                "unknown-member",
                f"'{member.name}' is none of the values of '{variable.name}' (algorithm '{algorithm.name}')",
                member.place,
                path=f"perception.{algorithm.name}.identifies.{entry.variable.name}",
                way_out=f"did you mean '{near}'?" if near else f"values are {listed}",
                fix=member_fix(member.name, near, variable.type.values, member.place, scope.mentioned)
                if near
                else None,
            )


def _wrong_form(algorithm: Algorithm, place: Place, message: str, way_out: str, variable: Variable) -> Diagnostic:
    path = f"perception.{algorithm.name}.identifies.{variable.name}"
    related = (Related("declared here", variable.places.get("type", variable.place)),)
    return finding("wrong-value-identified", message, place, path=path, way_out=way_out, related=related)


def _misused(algorithm: Algorithm, usage: Usage, declared: Place, message: str, way_out: str) -> Diagnostic:
    path = f"perception.{algorithm.name}.uses.{usage.resource.name}"
    related = (Related("declared here", declared),)
    return finding("misused-resource", message, usage.place, path=path, way_out=way_out, related=related)


def _a(variable: Variable) -> str:
    return f"an {variable.type.kind}" if variable.type.kind is Kind.INT else f"a {variable.type.kind}"
