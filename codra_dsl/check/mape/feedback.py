"""Phases 4 and 5 for loops: adaptations that follow from what they set or choose themselves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

from codra_dsl import graph
from codra_dsl.check.possible import can_hold, implies
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import Faults, Scope
from codra_dsl.diagnostics import Diagnostic, Place, Related
from codra_dsl.expression import Compare, Comparison, Name, Node, Or, Text, Truth, names_in, spelt_out
from codra_dsl.fuzzy.model import propositions
from codra_dsl.model import ADAPTER, Adaptation, Condition, Course, Parameter, weight_name


def self_defeating(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """What an adaptation sets can be set at all, and then there is a value, or an action, that it leaves as it is."""
    never = list(_never_set(scope, faults))
    yield from never
    yield from _restless_courses(scope, faults)
    elements = frozenset(("adaptation", each.path.split(".")[1]) for each in never)
    yield from _restless_parameters(scope, Faults(faults.elements | elements, faults.meant))


def _never_set(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """Yield what only adaptations set and what can only become known once it is known; each circle is told once."""
    values = {
        own: (adaptation, tree)
        for adaptation, own, tree in set_variables(scope, faults)
        if [source.name for source in scope.variables[own].sources] == [ADAPTER]
    }
    needs = {own: [each.name for each in names_in(tree)] for own, (_, tree) in values.items()}
    equal_to_itself = {own: _equal(tree, tree) for own, (_, tree) in values.items()}  # nothing unknown is
    unknown = frozenset(values)
    while True:
        while known := {own for own in unknown if can_hold([equal_to_itself[own]], unknown, scope.context_types)}:
            unknown -= known
        waits = {own: [need for need in needs[own] if need in unknown] for own in sorted(unknown)}
        circle = next((found for own in waits if (found := graph.cycle_through(waits, own))), ())
        if not circle:
            return
        adaptation, _ = values[circle[0]]
        path = (*circle, circle[0])
        message = (
            f"adaptation '{adaptation.name}' never sets '{circle[0]}', which waits for itself: {' -> '.join(path)}"
        )
        way_out = f"say what holds at first, with 'known({path[1]}) and ...', or with 'source' who else writes it"
        yield _defeated(adaptation, "value", message, way_out)
        unknown -= set(circle)


def _restless_parameters(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    for adaptation, own, tree in set_variables(scope, faults):
        is_free = adaptation.dwell_s == 0.0 and own in {each.name for each in names_in(tree)}
        if is_free and not can_hold([_equal(tree, _name(own))], (), scope.context_types):
            message = f"adaptation '{adaptation.name}' never comes to rest: whatever '{own}' is, it sets something else"
            way_out = "let it follow from something else, or state a 'dwell' if it is to alternate"
            yield _defeated(adaptation, "value", message, way_out)


def _restless_courses(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    for adaptation in scope.spec.adaptation:
        course = adaptation.does
        if isinstance(course, Course) and course.always and faults.sound("adaptation", adaptation.name):
            trees = [_tree(scope, rule.condition) for rule in course.always]
            if not any(_rests(scope, adaptation.name, course, trees, each.name) for each in course.choose):
                message = f"adaptation '{adaptation.name}' never comes to rest: hard rules leave each of its actions"
                yield _defeated(adaptation, "always", message, "let a rule hold no longer once its action is chosen")


def _rests(scope: Scope, own: str, course: Course, trees: Sequence[Node | None], action: str) -> bool:
    """Return whether an action may stay: no hard rule holds while it is chosen, or the first that does chooses it."""
    types = scope.context_types
    conditions = [Truth(start=0, end=0, value=True) if each is None else each for each in trees]
    chosen = _equal(_name(own), Text(start=0, end=0, value=action))
    if None in trees or not implies([chosen], [_any(conditions)], types):
        return True
    return any(
        rule.action.name == action and not implies([chosen, conditions[index]], [_any(conditions[:index])], types)
        for index, rule in enumerate(course.always)
    )


def set_variables(scope: Scope, faults: Faults) -> Iterator[tuple[Adaptation, str, Node]]:
    """Yield each adaptation that sets a variable, with that and its value, where nothing is wrong with them."""
    for adaptation in scope.spec.adaptation:
        if isinstance(adaptation.does, Parameter) and faults.sound("adaptation", adaptation.name):
            own, tree = adaptation.does.variable.name, _tree(scope, adaptation.does.value)
            if own in scope.variables and faults.sound("context", own) and tree is not None:
                yield adaptation, own, tree


def _tree(scope: Scope, condition: Condition) -> Node | None:
    judgement = scope.judgement(condition)
    return None if judgement is None or judgement.problems else spelt_out(judgement.typed.node)


def _name(name: str) -> Name:
    return Name(start=0, end=0, name=name)


def _equal(one: Node, other: Node) -> Node:
    return Compare(start=0, end=0, first=one, rest=((Comparison.EQUAL, other),))


def _any(conditions: Sequence[Node]) -> Node:
    return Or(start=0, end=0, operands=(Truth(start=0, end=0, value=False), *conditions))


def _defeated(adaptation: Adaptation, key: str, message: str, way_out: str) -> Diagnostic:
    place = adaptation.places.get(key, adaptation.place)
    path = f"adaptation.{adaptation.name}.{key}"
    return finding("self-defeating-adaptation", message, place, path=path, way_out=way_out)


def fed_back(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """No adaptation follows from what it sets or chooses itself; each circle is told once."""
    needs = _needs(scope)
    order = {name: tuple(places) for name, places in needs.items()}
    told: set[str] = set()
    for adaptation in scope.spec.adaptation:
        own, does = _written(adaptation), "sets" if isinstance(adaptation.does, Parameter) else "chooses"
        circle = graph.cycle_through(order, own) if own not in told else ()
        told.update(circle)
        if not circle or not faults.sound("adaptation", adaptation.name):
            continue
        path = (*circle, own)
        first, *others = [(name, need, needs[name][need]) for name, need in pairwise(path)]
        yield finding(
            "adaptation-feedback",
            f"adaptation '{adaptation.name}' follows from what it {does} itself: {' -> '.join(path)}",
            first[2],
            path=f"adaptation.{adaptation.name}",
            way_out="read what is measured instead, or say in a comment '# codra: ignore[CDR7127]' why it is meant",
            related=tuple(Related(f"'{name}' follows from '{need}'", place) for name, need, place in others),
        )


def _written(adaptation: Adaptation) -> str:
    """Return the context-variable that an adaptation writes."""
    return adaptation.does.variable.name if isinstance(adaptation.does, Parameter) else adaptation.name


def _needs(scope: Scope) -> Mapping[str, Mapping[str, Place]]:
    """Return what each variable follows from that loops work out, set or choose, and where that is said first."""
    found: dict[str, dict[str, Place]] = {}
    for section, output in scope.book.outputs:
        name = output.name if section == "metrics" else weight_name(output.name)
        for rule in scope.book.rules[section, output.name]:
            for each in propositions(rule.rule.antecedent) if rule.rule is not None else ():
                found.setdefault(name, {}).setdefault(each.variable, rule.phrase.place)
    for variable in scope.spec.context:
        if variable.rate is not None:
            found.setdefault(variable.name, {})[variable.rate.of.name] = variable.rate.of.place
    for adaptation in scope.spec.adaptation:
        own = found.setdefault(_written(adaptation), {})
        for action in adaptation.does.choose if isinstance(adaptation.does, Course) else ():
            own.setdefault(weight_name(action.name), action.place)
    for site in scope.sites:
        if site.owner[0] == "adaptation":
            for read in site.names:
                found[site.variable or site.owner[1]].setdefault(read.name, site.condition.place_of(read))
    return found


SELF_DEFEATING = (self_defeating,)
"""The rules of phase 4."""

FED_BACK = (fed_back,)
"""The rules of phase 5."""
