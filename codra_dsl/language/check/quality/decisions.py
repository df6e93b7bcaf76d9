"""Decisions on variables that nothing can observe, and variables that no decision needs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import MAIN_EXECUTION, OBSERVER, FaultyElements, SpecIndex
from codra_dsl.language.check.knowledge.owners import read_elements
from codra_dsl.language.check.quality.exclusion import excluded_previews
from codra_dsl.language.check.quality.reach import can_judge_reach, unreached_settings
from codra_dsl.language.diagnostics import Diagnostic, Place, Related
from codra_dsl.language.model import ADAPTER, ANALYST, Parameter, Skill, Variable

MAX_RELATED_PLACES = 5
"""The maximum number of further places of one kind in a finding."""


def unreached_variables(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Every variable is needed by a skill or a loop, directly or through other variables.

    If no skill is declared, all variables are observed. Variables that loops add or set are exempt, since programs read
    them.
    """
    if not can_judge_reach(spec_index):
        return
    unreached_observer_variables = {
        reference.name for setting in unreached_settings(spec_index) for reference in setting.identifies
    }
    variables_read_by_agents = {
        element.name
        for agent in spec_index.spec.agents
        for element in read_elements(spec_index.declared_graph, agent)
        if element.section == "context"
    }
    set_names = {
        adaptation.does.variable.name
        for adaptation in spec_index.spec.adaptation
        if isinstance(adaptation.does, Parameter)
    }
    for variable in spec_index.variables.values():
        name = variable.name
        is_exempt = (
            name in set_names
            or name in spec_index.variables_read_by_loops
            or any(source.name in (ADAPTER, ANALYST) for source in variable.sources)
        )
        is_exempt = is_exempt or variable.pose_condition is not None or name in unreached_observer_variables
        is_exempt = is_exempt or name in spec_index.spec.damaged.get("context", ())
        is_exempt = is_exempt or (name in variables_read_by_agents and name not in spec_index.producers)
        if name not in spec_index.variables_in_force and not is_exempt and faults.is_sound("context", name):
            message, help = f"no skill needs context-variable '{name}'", "name it under 'preview' or 'monitor'"
            if name in spec_index.producers:
                message += ": it gets no observer"
            else:
                help = f"its source writes the variable, but no observer uses it: {help}"
            if variable.derived is not None:
                help = "name it under 'preview' or 'monitor'"
            help += ", or remove it"
            yield finding("unreached-variable", message, variable.place, path=f"context.{name}", help=help)


def decisions_without_observer(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Every variable that a skill previews can be observed: by an observer, or by the main execution as a fallback."""
    for variable, mentions in _unidentified_variables(spec_index, faults, _preview_mentions(spec_index, faults)):
        sources = [source.name for source in variable.sources]
        if OBSERVER in sources or MAIN_EXECUTION in sources or _has_topic(spec_index, variable):
            continue
        (skill, place), *others = mentions
        agents_text = " and ".join(f"agent '{name}'" for name in sources)
        yield finding(
            "decision-without-observer",
            f"skill '{skill.name}' decides on '{variable.name}', which nothing can observe: "
            f"only {agents_text} can write it",
            place,
            path=f"skills.{skill.name}.preview",
            help="add an algorithm that identifies it, or 'main_execution' to its 'source' "
            "if the robot's own code can observe it",
            related=(_source_place(variable), *_other_places(others)),
        )


def _has_topic(spec_index: SpecIndex, variable: Variable) -> bool:
    """Return whether a variable has, or may have, a topic of ROS 2, whose messages renew it like an observer."""
    return variable.ros is not None or not spec_index.is_readable("context", variable.name, "ros")


def unwatched_monitors(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Every variable that a skill monitors has a source other than the main execution, which is busy acting."""
    for variable, mentions in _unidentified_variables(spec_index, faults, _monitor_mentions(spec_index, faults)):
        if {source.name for source in variable.sources} != {MAIN_EXECUTION} or _has_topic(spec_index, variable):
            continue
        (skill, place), *others = mentions
        yield finding(
            "unwatched-monitor",
            f"skill '{skill.name}' monitors '{variable.name}', which nothing observes meanwhile: "
            "only the main execution, which is busy acting, writes it",
            place,
            path=f"skills.{skill.name}.monitor.{variable.name}",
            help="add an algorithm that identifies it, add an agent to its 'source', or decide on it in 'preview'",
            related=(_source_place(variable), *_other_places(others)),
        )


DECISION_CHECKS = (unreached_variables, decisions_without_observer, unwatched_monitors, excluded_previews)
"""The checks of this module."""


_Mentions = Mapping[str, list[tuple[Skill, Place]]]


def _sound_skills(spec_index: SpecIndex, faults: FaultyElements, key: str) -> Iterator[Skill]:
    """Yield the sound skills with a readable key."""
    for skill in spec_index.spec.skills:
        if faults.is_sound("skills", skill.name) and spec_index.is_readable("skills", skill.name, key):
            yield skill


def _preview_mentions(spec_index: SpecIndex, faults: FaultyElements) -> _Mentions:
    mentions: dict[str, list[tuple[Skill, Place]]] = {}
    for skill in _sound_skills(spec_index, faults, "preview"):
        for reference in skill.preview:
            mentions.setdefault(reference.name, []).append((skill, reference.place))
    return mentions


def _monitor_mentions(spec_index: SpecIndex, faults: FaultyElements) -> _Mentions:
    mentions: dict[str, list[tuple[Skill, Place]]] = {}
    for skill in _sound_skills(spec_index, faults, "monitor"):
        for expectation in skill.monitor:
            mentions.setdefault(expectation.variable.name, []).append((skill, expectation.variable.place))
    return mentions


def _unidentified_variables(
    spec_index: SpecIndex, faults: FaultyElements, mentions: _Mentions
) -> Iterator[tuple[Variable, list[tuple[Skill, Place]]]]:
    """Yield the variables that have sources but no algorithm, each with the skills that refer to it."""
    if spec_index.has_damage("perception", "identifies"):
        return
    for name, skills_and_places in mentions.items():
        variable = spec_index.variables.get(name)
        if (
            variable is None
            or variable.derived is not None
            or not variable.sources
            or name in spec_index.producers
            or variable.pose_condition is not None
            or name in faults.suggested_variables
        ):
            continue
        if faults.is_sound("context", name) and spec_index.is_readable("context", name, "source"):
            yield variable, skills_and_places


def _source_place(variable: Variable) -> Related:
    return Related("its source", variable.places.get("source", variable.place))


def _other_places(others: list[tuple[Skill, Place]]) -> Iterator[Related]:
    for skill, place in others[:MAX_RELATED_PLACES]:
        yield Related(f"also in skill '{skill.name}'", place)
