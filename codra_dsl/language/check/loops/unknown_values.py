"""Checks of loops (phase 5): a parameter does not keep a value that nobody stated may be kept.

While the value of a `set` adaptation is unknown, its variable gets the value of `otherwise`. Without `otherwise`, the
last value would stay, such as a high speed after the lidar has failed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.check.loops.feedback import adapted_variables
from codra_dsl.language.check.loops.firing import silent_combinations
from codra_dsl.language.check.quality.trust import endless_validity, first_trusting_algorithms, validity_help
from codra_dsl.language.check.solver.budget import current_budget
from codra_dsl.language.check.solver.satisfiable import is_always_known
from codra_dsl.language.diagnostics import Diagnostic, Related
from codra_dsl.language.expression import Call, Name, Node, names_in, reads_of, walk
from codra_dsl.language.model import ADAPTER, FOREVER_S, Course, Parameter, Variable, weight_name

_VARIABLE_KEYS = ("source", "valid_for", "when_unobservable")


def unknown_adapted_values(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """A parameter whose value can become unknown states `otherwise`."""
    for adaptation, name, tree in adapted_variables(spec_index, faults):
        does = adaptation.does
        if not isinstance(does, Parameter) or does.otherwise is not None:
            continue
        if not spec_index.is_readable("adaptation", adaptation.name, "otherwise"):
            continue
        reasons = {
            read_name: reason
            for read_name in dict.fromkeys(read_name.name for read_name in names_in(tree))
            if (reason := _reason_for_unknown(spec_index, faults, read_name))
        }
        culprits = _decisive_names(spec_index, tree, tuple(reasons))
        if not culprits:
            continue
        state_text = _state_text(spec_index, tree, culprits)
        yield finding(
            "unknown-adapted-value",
            f"adaptation '{adaptation.name}' keeps the last value of '{name}' while {state_text}",
            does.value.place,
            path=f"adaptation.{adaptation.name}.value",
            help="add 'otherwise: VALUE' with a value that is right while nothing is known",
            related=tuple(
                Related(f"'{culprit}' can become unknown: {reasons[culprit]}", spec_index.variables[culprit].place)
                for culprit in culprits
                if culprit in spec_index.variables
            ),
        )


def unnoticed_inputs(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Every variable in the value of a parameter states how long it is valid, or its age is part of the value.

    Otherwise the parameter follows a value that stays although its writer has stopped. A variable that a precondition
    reads has a finding of its own.
    """
    reported_names = set(first_trusting_algorithms(spec_index))
    for adaptation, _, tree in adapted_variables(spec_index, faults):
        for read_name in _names_with_any_age(tree):
            variable = spec_index.variables.get(read_name.name)
            if variable is None or variable.name in reported_names:
                continue
            reported_names.add(variable.name)
            reason = _endless_validity(spec_index, faults, variable)
            if reason:
                assert isinstance(adaptation.does, Parameter)
                place = adaptation.does.value.place_of(read_name)
                yield finding(
                    "unnoticed-input",
                    f"adaptation '{adaptation.name}' reads '{variable.name}', but its value never expires: {reason}",
                    variable.place,
                    path=f"context.{variable.name}",
                    help=validity_help(spec_index, variable),
                    related=(Related(f"adaptation '{adaptation.name}' reads it", place),),
                )


def _names_with_any_age(tree: Node) -> Iterator[Name]:
    """Yield the mentions of names whose values are used, whatever their age."""
    arguments = {
        function: [
            argument
            for part in walk(tree)
            if isinstance(part, Call) and part.function == function
            for argument in part.arguments
            if isinstance(argument, Name)
        ]
        for function in ("known", "age")
    }
    argument_ids = {id(argument) for argument in arguments["known"]}
    judged_names = {argument.name for argument in arguments["age"]}
    return (name for name in names_in(tree) if name.name not in judged_names and id(name) not in argument_ids)


def _endless_validity(spec_index: SpecIndex, faults: FaultyElements, variable: Variable) -> str:
    """Return why a variable that outside writers or observers write never expires; empty if it does, or may expire."""
    is_checkable = faults.is_sound("context", variable.name) and spec_index.is_readable(
        "context", variable.name, *_VARIABLE_KEYS
    )
    is_adapted = ADAPTER in (source.name for source in variable.sources)
    is_computed = variable.is_derived or variable.rate is not None or is_adapted
    return endless_validity(spec_index, variable) if is_checkable and not is_computed else ""


def _decisive_names(spec_index: SpecIndex, tree: Node, names: Sequence[str]) -> tuple[str, ...]:
    """Return the names that make a value unknown if they become unknown; () if the value is known in every case.

    If no name does so by itself, but several names together do, all names are returned.
    """
    types = spec_index.context_types
    if not names or is_always_known(tree, names, types) or current_budget().has_undecided:
        return ()
    decisive_names = tuple(name for name in names if not is_always_known(tree, (name,), types))
    return decisive_names or tuple(names)


def _state_text(spec_index: SpecIndex, tree: Node, culprits: Sequence[str]) -> str:
    """Return in which state of its inputs a value is unknown."""
    names = [f"'{culprit}'" for culprit in culprits]
    is_each_decisive = not is_always_known(tree, culprits[:1], spec_index.context_types)
    return f"{' or '.join(names)} is unknown" if is_each_decisive else f"{' and '.join(names)} are unknown"


def _reason_for_unknown(spec_index: SpecIndex, faults: FaultyElements, name: str) -> str:
    """Return why a variable can become unknown after it was known; empty if it cannot, or if this is not certain.

    Metrics, weights and courses are computed even while inputs are unknown. A stated `valid_for: forever` means that
    the value may be kept.
    """
    function, first, second = reads_of(name)
    if function:
        return "a pose can become stale" if _can_pose_become_stale(spec_index, first, second) else ""
    variable = spec_index.variables.get(name)
    if variable is None or not faults.is_sound("context", name):
        return ""
    if variable.is_derived:
        return "in some cases no rule fires" if _can_be_silent(spec_index, faults, name) else ""
    if variable.rate is not None:
        return "a rate is known only while readings span half of 'over'"
    if not spec_index.is_readable("context", name, *_VARIABLE_KEYS):
        return ""
    if variable.valid_for_s < FOREVER_S:
        return f"its evidence is valid for {variable.valid_for_s:g} s"
    skill = next((skill for skill in spec_index.spec.skills if name in {change.name for change in skill.changes}), None)
    if skill is not None:
        return f"skill '{skill.name}' changes it"
    return "its algorithm can fail" if name in spec_index.producers else ""


def _can_pose_become_stale(spec_index: SpecIndex, first: str, second: str) -> bool:
    graph = spec_index.declared_graph
    motions = (graph.edges[name].motion for name in graph.pose_edges_between(first, second))
    moving = [motion for motion in motions if motion is not None and not motion.is_static]
    return any(motion.valid_for_s is not None and motion.valid_for_s < FOREVER_S for motion in moving)


def _can_be_silent(spec_index: SpecIndex, faults: FaultyElements, name: str) -> bool:
    """Return whether no rule of a metric or a weight fires in some case. A course always has an action."""
    is_course = any(
        adaptation.name == name and isinstance(adaptation.does, Course) for adaptation in spec_index.spec.adaptation
    )
    return not is_course and any(
        silent_combinations(spec_index, faults, section, output)
        for section, output in spec_index.parsed_rules.outputs
        if name == (output.name if section == "metrics" else weight_name(output.name))
    )


UNKNOWN_VALUE_CHECKS = (unknown_adapted_values, unnoticed_inputs)
"""The checks of this module."""
