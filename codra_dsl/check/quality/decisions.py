"""Decisions that nothing can answer, and variables that no decision needs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from codra_dsl.check.knowledge.owners import reads
from codra_dsl.check.quality.exclusion import excluded_previews
from codra_dsl.check.quality.reach import judges_reach, unreached_settings
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import MAIN_EXECUTION, OBSERVER, Faults, Scope
from codra_dsl.diagnostics import Diagnostic, Place, Related
from codra_dsl.model import ADAPTER, ANALYST, ObserverSetting, Skill, Variable

MAX_TOLD = 5
"""How many further places of one kind a finding names."""


def unreached_variables(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """What no skill or loop needs, directly or through others, is not observed; without skills everything is.

    What loops bring along or set is there for programs to follow.
    """
    if not judges_reach(scope):
        return
    of_observers = {name for setting in unreached_settings(scope) for name in _named(setting)}
    of_agents = {
        thing.name for agent in scope.spec.agents for thing in reads(scope.world, agent) if thing.section == "context"
    }
    for variable in scope.variables.values():
        name = variable.name
        told = name in scope.read_by_loops or any(source.name in (ADAPTER, ANALYST) for source in variable.sources)
        told = told or variable.posed is not None or name in of_observers
        told = told or name in scope.spec.damaged.get("context", ())
        told = told or (name in of_agents and name not in scope.producers)
        if name not in scope.reached and not told and faults.sound("context", name):
            message, way_out = f"no skill needs context-variable '{name}'", "name it under 'preview' or 'monitor'"
            if name in scope.producers:
                message += ": it gets no observer"
            else:
                way_out = f"it will be written but observed by nobody: {way_out}"
            way_out += ", or remove it"
            yield finding("unreached-variable", message, variable.place, path=f"context.{name}", way_out=way_out)


def decisions_without_observer(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """What a skill decides on can be looked at: by an observer, or by the main execution as its fallback."""
    for variable, mentions in _unidentified(scope, faults, _previews(scope, faults)):
        sources = [source.name for source in variable.sources]
        if OBSERVER in sources or MAIN_EXECUTION in sources:
            continue
        (skill, place), *others = mentions
        named = " and ".join(f"agent '{name}'" for name in sources)
        yield finding(
            "decision-without-observer",
            f"skill '{skill.name}' decides on '{variable.name}', at which nothing can look: only {named} can write it",
            place,
            path=f"skills.{skill.name}.preview",
            way_out="add an algorithm that identifies it, or 'main_execution' to its 'source' "
            "if the robot's own code can look",
            related=(_source(variable), *_also(others)),
        )


def unwatched_monitors(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """What a skill watches while it acts is written by somebody who is not busy acting."""
    for variable, mentions in _unidentified(scope, faults, _monitored(scope, faults)):
        if {source.name for source in variable.sources} != {MAIN_EXECUTION}:
            continue
        (skill, place), *others = mentions
        yield finding(
            "unwatched-monitor",
            f"skill '{skill.name}' monitors '{variable.name}', which nobody watches meanwhile: "
            "only the main execution writes it, and that is busy acting",
            place,
            path=f"skills.{skill.name}.monitor.{variable.name}",
            way_out="add an algorithm that identifies it or an agent to its 'source', or decide on it in 'preview'",
            related=(_source(variable), *_also(others)),
        )


DECISIONS = (unreached_variables, decisions_without_observer, unwatched_monitors, excluded_previews)
"""The rules of this subject."""


def _named(setting: ObserverSetting) -> Iterator[str]:
    return (reference.name for reference in setting.identifies)


_Mentions = Mapping[str, list[tuple[Skill, Place]]]


def _sound_skills(scope: Scope, faults: Faults, key: str) -> Iterator[Skill]:
    """Yield the skills of which a key could be read and with which nothing is wrong."""
    for skill in scope.spec.skills:
        if faults.sound("skills", skill.name) and scope.readable("skills", skill.name, key):
            yield skill


def _previews(scope: Scope, faults: Faults) -> _Mentions:
    found: dict[str, list[tuple[Skill, Place]]] = {}
    for skill in _sound_skills(scope, faults, "preview"):
        for reference in skill.preview:
            found.setdefault(reference.name, []).append((skill, reference.place))
    return found


def _monitored(scope: Scope, faults: Faults) -> _Mentions:
    found: dict[str, list[tuple[Skill, Place]]] = {}
    for skill in _sound_skills(scope, faults, "monitor"):
        for expectation in skill.monitor:
            found.setdefault(expectation.variable.name, []).append((skill, expectation.variable.place))
    return found


def _unidentified(
    scope: Scope, faults: Faults, mentions: _Mentions
) -> Iterator[tuple[Variable, list[tuple[Skill, Place]]]]:
    """Yield the variables that have sources but no algorithm, with the skills that name them."""
    if scope.lost("perception", "identifies"):
        return
    for name, found in mentions.items():
        variable = scope.variables.get(name)
        if variable is None or not variable.sources or name in scope.producers or name in faults.meant:
            continue
        if faults.sound("context", name) and scope.readable("context", name, "source"):
            yield variable, found


def _source(variable: Variable) -> Related:
    return Related("its source", variable.places.get("source", variable.place))


def _also(others: list[tuple[Skill, Place]]) -> Iterator[Related]:
    for skill, place in others[:MAX_TOLD]:
        yield Related(f"also in skill '{skill.name}'", place)
