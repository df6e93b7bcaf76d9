"""Phase 5 for fuzzy rules: which of them act where. Every term holds on intervals, so that a few cells tell it all."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise, product

from codra_dsl.check.mape.book import ReadRule, members, range_of
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import Faults, Scope
from codra_dsl.diagnostics import Diagnostic, Related
from codra_dsl.fuzzy.model import And, Antecedent, Or, Proposition, Rule, Term
from codra_dsl.fuzzy.supports import Extent, extent
from codra_dsl.fuzzy.words import Hedge
from codra_dsl.model import Output, Variable

MAX_CELLS = 20_000
"""So many combinations are looked at; with more, an output is left alone."""


@dataclass(frozen=True, slots=True)
class Cell:
    """Numbers of a variable for which no term changes whether it holds.

    Attributes:
        holding: the terms whose degree is above 0; `wholly` those whose degree is 1.
        words: what the variable is there, for people.
        is_point: whether it is a single number among others.
    """

    holding: frozenset[str]
    wholly: frozenset[str]
    words: str
    is_point: bool = False


def cells(variable: Variable, terms: tuple[Term, ...]) -> tuple[Cell, ...]:
    """Return all cells of a variable that states a range."""
    extents = {term.name: extent(term) for term in terms}
    if members(variable):
        return tuple(_cell(float(index), extents, name) for index, name in enumerate(members(variable)))
    low, high = range_of(variable) or (0.0, 0.0)
    inner = {end for each in extents.values() for end in each.ends if low < end < high}
    ends = (low, *sorted(inner), high)
    unit = f" {variable.type.unit}" if variable.type.unit else ""
    found = [_cell(low, extents, f"{low:g}{unit}", is_point=low < high)]
    for one, other in pairwise(ends):
        if one < other:
            words = f"from {one:g}{unit} to {other:g}{unit}"
            found += [_cell((one + other) / 2.0, extents, words)]
            found += [_cell(other, extents, f"{other:g}{unit}", is_point=True)]
    return tuple(found)


def _cell(x: float, extents: Mapping[str, Extent], words: str, *, is_point: bool = False) -> Cell:
    holding = frozenset(name for name, each in extents.items() if each.holds(x))
    wholly = frozenset(name for name, each in extents.items() if each.holds_wholly(x))
    return Cell(holding, wholly, words, is_point)


Scene = Mapping[str, Cell]
"""A cell of each variable."""


def acts(antecedent: Antecedent, scene: Scene) -> bool:
    """Return whether an antecedent holds at all, with norms that are above 0 where both sides are."""
    if isinstance(antecedent, And):
        return acts(antecedent.left, scene) and acts(antecedent.right, scene)
    if isinstance(antecedent, Or):
        return acts(antecedent.left, scene) or acts(antecedent.right, scene)
    if Hedge.ANY in antecedent.hedges:
        return True
    cell = scene[antecedent.variable]
    negations = antecedent.hedges.count(Hedge.NOT)
    if negations > 1:
        return True  # rare, and never wrong to allow
    return antecedent.term in cell.holding if negations == 0 else antecedent.term not in cell.wholly


def uncovered_ranges(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """Several terms of a number cover its range together, and each holds somewhere in it."""
    for variable in scope.spec.context:
        whole = faults.sound("context", variable.name) and scope.readable("context", variable.name, "terms", "range")
        if not variable.terms or variable.is_derived or not whole or variable.type.range is None:
            continue
        found = cells(variable, scope.book.terms(variable))
        place, path = variable.places.get("terms", variable.place), f"context.{variable.name}.terms"
        for term in variable.terms:
            if not any(term.name in cell.holding for cell in found):
                message = f"term '{term.name}' of '{variable.name}' holds nowhere in its range"
                way_out = "correct its numbers, or remove it"
                yield finding("uncovered-range", message, term.place, path=f"{path}.{term.name}", way_out=way_out)
        gap = next((cell for cell in found if not cell.holding and not cell.is_point), None)
        if gap is not None and len(variable.terms) > 1:
            message = f"no term of '{variable.name}' holds {gap.words}"
            yield finding("uncovered-range", message, place, path=path, way_out="let neighbours overlap")


def idle_rules(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """Every rule can act, and in every case some rule does."""
    for section, output in scope.book.outputs:
        read = scope.book.rules[section, output.name]
        rules = [each.rule for each in read if each.rule is not None]
        if not faults.sound(section, output.name) or len(rules) < len(read) or not rules:
            continue
        if any(each.problems for each in read):
            continue
        scenes = list(_scenes(scope, faults, scope.book.named(section, output.name)))
        if not scenes:
            continue
        yield from _never_acting(section, output, read, scenes)
        yield from _uncovered(section, output, rules, scenes)


_KEYS = ("type", "range", "values", "terms")


def _scenes(scope: Scope, faults: Faults, names: tuple[str, ...]) -> Iterator[Scene]:
    variables = [scope.book.variables[name] for name in names]
    if any(range_of(each) is None or not faults.sound("context", each.name) for each in variables):
        return
    if not all(scope.readable("context", name, *_KEYS) for name in names):
        return
    found = [cells(each, scope.book.terms(each)) for each in variables]
    count = 1
    for each in found:
        count *= len(each)
    if count <= MAX_CELLS:
        yield from (dict(zip(names, scene, strict=True)) for scene in product(*found))


def _never_acting(
    section: str, output: Output, read: tuple[ReadRule, ...], scenes: list[Scene]
) -> Iterator[Diagnostic]:
    for number, each in enumerate(read):
        if each.rule is None:
            continue
        if each.rule.weight == 0.0:
            reason = "its weight is 0"
        elif not any(acts(each.rule.antecedent, scene) for scene in scenes):
            reason = "nothing makes its condition hold"
        else:
            continue
        message = f"this rule of '{output.name}' never acts: {reason}"
        path = f"{section}.{output.name}.rules.{number}"
        yield finding("idle-fuzzy-rule", message, each.phrase.place, path=path, way_out="correct it, or remove it")


def _uncovered(section: str, output: Output, rules: list[Rule], scenes: list[Scene]) -> Iterator[Diagnostic]:
    silent = [
        scene
        for scene in scenes
        if not any(cell.is_point for cell in scene.values())
        and not any(rule.weight > 0.0 and acts(rule.antecedent, scene) for rule in rules)
    ]
    if silent:
        said = " and ".join(f"{name} is {cell.words}" for name, cell in silent[0].items())
        more = f", and in {len(silent) - 1} more cases" if len(silent) > 1 else ""
        message = f"no rule of '{output.name}' acts where {said}{more}"
        place = output.places.get("rules", output.place)
        way_out = "add a rule: without one it is unknown there"
        yield finding("silent-combination", message, place, path=f"{section}.{output.name}.rules", way_out=way_out)


def contradictory_rules(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """No two rules of an output conclude different things, or the same, from the same."""
    for section, output in scope.book.outputs:
        first: dict[object, ReadRule] = {}
        for number, each in enumerate(scope.book.rules[section, output.name]):
            if each.rule is None:
                continue
            other = first.setdefault(_meaning(each.rule.antecedent), each)
            if other is each or other.rule is None:
                continue
            same = other.rule.conclusions == each.rule.conclusions
            what = "says what another one says" if same else "contradicts another one"
            message = f"this rule of '{output.name}' {what}: both have the same condition"
            path = f"{section}.{output.name}.rules.{number}"
            related = (Related("the other rule", other.phrase.place),)
            way_out = "remove one of them" if same else "remove one of them, or tell their conditions apart"
            yield finding(
                "contradictory-fuzzy-rule", message, each.phrase.place, path=path, way_out=way_out, related=related
            )


def _meaning(antecedent: Antecedent) -> object:
    """Return what an antecedent says, whatever the order of what is joined by one word."""
    if isinstance(antecedent, Proposition):
        return antecedent
    kind = type(antecedent)
    parts: set[object] = set()
    waiting: list[Antecedent] = [antecedent]
    while waiting:
        part = waiting.pop()
        if isinstance(part, kind) and not isinstance(part, Proposition):
            waiting += [part.left, part.right]
        else:
            parts.add(_meaning(part))
    return kind, frozenset(parts)


FIRING = (uncovered_ranges, idle_rules, contradictory_rules)
"""The rules of this subject."""
