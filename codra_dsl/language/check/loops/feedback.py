"""Checks of loops (phases 4 and 5): adaptations that depend on values that they set or choose themselves.

Such feedback is allowed, because it makes hysteresis possible. Feedback is an error only if no value would be stable,
or if no value would ever be known.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

from codra_dsl.language import graph
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.check.solver.satisfiable import can_hold, implies
from codra_dsl.language.diagnostics import Diagnostic, Place, Related
from codra_dsl.language.expression import Compare, Comparison, Name, Node, Or, Text, Truth, names_in
from codra_dsl.language.fuzzy.model import propositions
from codra_dsl.language.model import (
    ADAPTER,
    Adaptation,
    Course,
    Parameter,
    filtered_weight_name,
    weight_name,
)


def self_defeating_adaptations(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Every adaptation can set its variable, and has a stable value or action, which the adaptation does not change."""
    findings = list(_never_set_findings(spec_index, faults))
    yield from findings
    yield from _unstable_course_findings(spec_index, faults)
    faulty_adaptations = frozenset(("adaptation", diagnostic.path.split(".")[1]) for diagnostic in findings)
    yield from _unstable_parameter_findings(
        spec_index, FaultyElements(faults.elements | faulty_adaptations, faults.suggested_variables)
    )


def _never_set_findings(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Yield findings about variables that only adaptations set and that wait for themselves; one for each cycle."""
    adaptations_and_trees = {
        name: (adaptation, tree)
        for adaptation, name, tree in adapted_variables(spec_index, faults)
        if [source.name for source in spec_index.variables[name].sources] == [ADAPTER]
        and isinstance(adaptation.does, Parameter)
        and adaptation.does.otherwise is None
    }
    needs = {
        name: [read_name.name for read_name in names_in(tree)] for name, (_, tree) in adaptations_and_trees.items()
    }
    # a comparison of a value with itself is true only if the value is known
    self_equalities = {name: _equality(tree, tree) for name, (_, tree) in adaptations_and_trees.items()}
    unknown_names = frozenset(adaptations_and_trees)
    while True:
        while known_names := {
            name for name in unknown_names if can_hold([self_equalities[name]], unknown_names, spec_index.context_types)
        }:
            unknown_names -= known_names
        awaited_names = {
            name: [need for need in needs[name] if need in unknown_names] for name in sorted(unknown_names)
        }
        waiting_cycle = next(
            (cycle for name in awaited_names if (cycle := graph.cycle_through(awaited_names, name))), ()
        )
        if not waiting_cycle:
            return
        adaptation, _ = adaptations_and_trees[waiting_cycle[0]]
        path = (*waiting_cycle, waiting_cycle[0])
        message = (
            f"adaptation '{adaptation.name}' never sets '{waiting_cycle[0]}', "
            f"which waits for itself: {' -> '.join(path)}"
        )
        help = f"give a first value with 'known({path[1]}) and ...', or name another writer of it under 'source'"
        yield _self_defeating_finding(adaptation, "value", message, help)
        unknown_names -= set(waiting_cycle)


def _unstable_parameter_findings(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    for adaptation, name, tree in adapted_variables(spec_index, faults):
        has_undelayed_feedback = adaptation.dwell_s == 0.0 and name in {read_name.name for read_name in names_in(tree)}
        if has_undelayed_feedback and not can_hold([_equality(tree, _name_node(name))], (), spec_index.context_types):
            message = (
                f"adaptation '{adaptation.name}' never becomes stable: "
                f"for every value of '{name}', it sets another value"
            )
            help = f"compute '{name}' from other variables, or add a 'dwell' if the value should alternate"
            yield _self_defeating_finding(adaptation, "value", message, help)


def _unstable_course_findings(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    for adaptation in spec_index.spec.adaptation:
        course = adaptation.does
        if isinstance(course, Course) and course.always and faults.is_sound("adaptation", adaptation.name):
            # a rule whose condition must hold for some time may change the action, as a dwell may
            trees = [None if rule.for_s else spec_index.sound_tree(rule.condition) for rule in course.always]
            if not any(
                _can_be_stable(spec_index, adaptation.name, course, trees, reference.name)
                for reference in course.choose
            ):
                message = f"adaptation '{adaptation.name}' never becomes stable: hard rules replace each of its actions"
                yield _self_defeating_finding(
                    adaptation, "always", message, "make a rule false once its action is chosen"
                )


def _can_be_stable(spec_index: SpecIndex, name: str, course: Course, trees: Sequence[Node | None], action: str) -> bool:
    """Return whether an action may remain chosen.

    It may if, while the action is chosen, no hard rule holds, or the first rule that holds chooses the same action.
    """
    types = spec_index.context_types
    conditions = [Truth(start=0, end=0, value=True) if tree is None else tree for tree in trees]
    chosen_condition = _equality(_name_node(name), Text(start=0, end=0, value=action))
    if None in trees or not implies([chosen_condition], [_disjunction(conditions)], types):
        return True
    return any(
        rule.action.name == action
        and not implies([chosen_condition, conditions[index]], [_disjunction(conditions[:index])], types)
        for index, rule in enumerate(course.always)
    )


def adapted_variables(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[tuple[Adaptation, str, Node]]:
    """Yield each sound adaptation that sets a variable, with the variable's name and the expression for the value."""
    for adaptation in spec_index.spec.adaptation:
        if isinstance(adaptation.does, Parameter) and faults.is_sound("adaptation", adaptation.name):
            name, tree = adaptation.does.variable.name, spec_index.sound_tree(adaptation.does.value)
            if name in spec_index.variables and faults.is_sound("context", name) and tree is not None:
                yield adaptation, name, tree


def _name_node(name: str) -> Name:
    return Name(start=0, end=0, name=name)


def _equality(one: Node, other: Node) -> Node:
    return Compare(start=0, end=0, first=one, rest=((Comparison.EQUAL, other),))


def _disjunction(conditions: Sequence[Node]) -> Node:
    return Or(start=0, end=0, operands=(Truth(start=0, end=0, value=False), *conditions))


def _self_defeating_finding(adaptation: Adaptation, key: str, message: str, help: str) -> Diagnostic:
    place = adaptation.places.get(key, adaptation.place)
    path = f"adaptation.{adaptation.name}.{key}"
    return finding("self-defeating-adaptation", message, place, path=path, help=help)


def adaptation_feedback(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """No adaptation, metric or weight depends on itself. There is one finding for each cycle."""
    dependencies = _dependencies(spec_index)
    dependency_names = {name: tuple(places) for name, places in dependencies.items()}
    reported_names: set[str] = set()
    for section, element, target, message in _computed_variables(spec_index):
        feedback_cycle = graph.cycle_through(dependency_names, target) if target not in reported_names else ()
        is_reported = section != "adaptation" and not reported_names.isdisjoint(feedback_cycle)
        reported_names.update(feedback_cycle)
        if not feedback_cycle or is_reported or not faults.is_sound(section, element):
            continue
        path = (*feedback_cycle, target)
        first, *others = [(name, dependency, dependencies[name][dependency]) for name, dependency in pairwise(path)]
        yield finding(
            "adaptation-feedback",
            f"{message}: {' -> '.join(path)}",
            first[2],
            path=f"{section}.{element}",
            help="read a measured value instead, or give the reason in a comment '# codra: ignore[CDR7127]'",
            related=tuple(Related(f"'{name}' depends on '{dependency}'", place) for name, dependency, place in others),
        )


def _computed_variables(spec_index: SpecIndex) -> Iterator[tuple[str, str, str, str]]:
    """Yield the section and name of each adaptation, metric and action, its variable, and the message about feedback.

    Adaptations come first: a cycle through an adaptation is reported there.
    """
    for adaptation in spec_index.spec.adaptation:
        verb = "sets" if isinstance(adaptation.does, Parameter) else "chooses"
        message = f"adaptation '{adaptation.name}' depends on a value that it {verb} itself"
        yield "adaptation", adaptation.name, _written_variable(adaptation), message
    for section, output in spec_index.parsed_rules.outputs:
        if section == "metrics":
            yield section, output.name, output.name, f"metric '{output.name}' depends on itself"
        else:
            yield section, output.name, weight_name(output.name), f"action '{output.name}' depends on its own weight"


def _written_variable(adaptation: Adaptation) -> str:
    """Return the context-variable that an adaptation writes; the adaptation's name if the variable is not stated."""
    name = adaptation.does.variable.name if isinstance(adaptation.does, Parameter) else ""
    return name or adaptation.name


def _dependencies(spec_index: SpecIndex) -> Mapping[str, Mapping[str, Place]]:
    """Return, for each variable that loops compute, set or choose, the dependencies, each with its first place."""
    dependencies: dict[str, dict[str, Place]] = {}
    for section, output in spec_index.parsed_rules.outputs:
        name = output.name if section == "metrics" else weight_name(output.name)
        for rule in spec_index.parsed_rules.rules[section, output.name]:
            for proposition in propositions(rule.rule.antecedent) if rule.rule is not None else ():
                dependencies.setdefault(name, {}).setdefault(proposition.variable, rule.phrase.place)
    for variable in spec_index.spec.context:
        if variable.rate is not None:
            dependencies.setdefault(variable.name, {})[variable.rate.of.name] = variable.rate.of.place
        if variable.derived is not None:
            inputs = spec_index.derived_inputs[variable.name]
            dependencies.setdefault(variable.name, {}).update(dict.fromkeys(inputs, variable.derived.place))
    for adaptation in spec_index.spec.adaptation:
        own_dependencies = dependencies.setdefault(_written_variable(adaptation), {})
        course = adaptation.does if isinstance(adaptation.does, Course) else None
        for action in () if course is None else course.choose:
            own_dependencies.setdefault(weight_name(action.name), action.place)
        for action in () if course is None or course.node is None else course.choose:
            dependencies[filtered_weight_name(action.name)] = {weight_name(action.name): action.place}
    for site in spec_index.sites:
        if site.owner[0] == "adaptation":
            for read_name in site.names:
                own_dependencies = dependencies.setdefault(site.variable or site.owner[1], {})
                own_dependencies.setdefault(read_name.name, site.condition.place_of(read_name))
    return dependencies


SELF_DEFEAT_CHECKS = (self_defeating_adaptations,)
"""The checks of phase 4."""

FEEDBACK_CHECKS = (adaptation_feedback,)
"""The checks of phase 5."""
