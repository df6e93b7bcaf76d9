"""A first spec for a main execution: one variable for each thing on which it decides, and its skills."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from codra_dsl.language.diagnostics import Place
from codra_dsl.tooling.main_execution.model import Decision, MainExecution, Role, ValueType
from codra_dsl.tooling.report.findings import visible_text

TO_DO = "to do"
_KEYS = ("preview", "monitor", "changes")


def draft(main_execution: MainExecution, name: str, source: str) -> str:
    """Return the text of a spec that lints without errors.

    Each element has its place in the source as a comment, and each thing that the source cannot state is a comment
    that begins with `to do`.

    Args:
        main_execution: the decisions. A spec needs at least one.
        name: the name of the spec.
        source: the path of the source, as the first comment shows it.
    """
    by_variable, by_skill = main_execution.by_variable(), main_execution.by_skill()
    perceived = {variable: decisions for variable, decisions in by_variable.items() if decisions[0].call}
    lines = [
        "codra: 1",
        f"name: {name}",
        "",
        f"# Drafted by codra import from {visible_text(source)}. Comments name the places in the source.",
        f"# Each comment '{TO_DO}' asks for something that the source does not state.",
        "context:",
        *(line for variable, decisions in by_variable.items() for line in _variable_lines(variable, decisions)),
    ]
    if perceived:
        lines += ["", "perception:"]
        for variable, decisions in perceived.items():
            lines += _algorithm_lines(variable, decisions, name)
    lines += ["", "skills:"]
    for skill, place in main_execution.skill_places.items():
        lines += _skill_lines(skill, place, by_skill[skill])
    return "".join(f"{line}\n" for line in lines)


def _variable_lines(variable: str, decisions: Sequence[Decision]) -> Iterator[str]:
    first = decisions[0]
    yield f"  {variable}:  # {_place_text(first.place)}: {_comment(first.text)}"
    yield f"    type: {_type_of(decisions)}"
    if first.call:
        yield f"    # {TO_DO}: for how long is an observed value valid? Write valid_for, e.g. 'valid_for: 10 s'."
    else:
        yield f"    source: main_execution  # {TO_DO}: does an algorithm identify it? Then add it below perception."


def _algorithm_lines(variable: str, decisions: Sequence[Decision], name: str) -> Iterator[str]:
    first = decisions[0]
    yield f"  look_for_{variable}:"
    yield f"    # {TO_DO}: write this function; the main execution uses {_comment(first.call)}."
    yield f"    call: {name}_perception:{variable}  # {_place_text(first.place)}"
    yield f"    # {TO_DO}: when can it be observed? Write observable_when with conditions, or remove this comment."
    yield f"    returns: {{value: {{type: {_type_of(decisions)}}}}}"
    yield f"    identifies: {{{variable}: value}}"


def _skill_lines(skill: str, place: Place, decisions: Sequence[Decision]) -> Iterator[str]:
    yield f"  {skill}:  # {_place_text(place)}"
    for key in _KEYS:
        places = {decision.name: decision.place for decision in reversed(decisions) if key in _keys_of(decision)}
        if places:
            yield f"    {key}:"
            yield from (f"      - {name}  # {_place_text(places[name])}" for name in _in_order(decisions, places))
    if all(decision.role is not Role.EFFECT for decision in decisions):
        yield f"    # {TO_DO}: which of the variables does the skill change by acting? Write 'changes: [...]'."


def _keys_of(decision: Decision) -> tuple[str, ...]:
    """Return the keys of a skill that have a variable. Only what an algorithm observes is monitored."""
    watching_key = "monitor" if decision.role is not Role.PRECONDITION and decision.call else "preview"
    if decision.role is not Role.EFFECT:
        return (watching_key,)
    return (watching_key, "changes") if decision.is_made else ("changes",)


def _in_order(decisions: Iterable[Decision], names: Iterable[str]) -> list[str]:
    """Return names in the order of the source."""
    wanted_names = set(names)
    return [name for name in dict.fromkeys(decision.name for decision in decisions) if name in wanted_names]


def _type_of(decisions: Iterable[Decision]) -> ValueType:
    """Return the type of a variable: the first one that is more than true or false, if there is one."""
    types = [decision.type for decision in decisions if decision.type is not ValueType.BOOL]
    return types[0] if types else ValueType.BOOL


def _place_text(place: Place) -> str:
    return f"{visible_text(place.span.file)}:{place.span.line}:{place.span.column}"


def _comment(text: str) -> str:
    """Return a text of the source for a comment: on one line, and without characters that YAML or a terminal obeys."""
    return " ".join(visible_text(text).split())
