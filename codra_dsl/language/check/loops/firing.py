"""Checks of fuzzy rules (phase 5): every rule can fire, and in every case some rule fires.

Every term holds on intervals, so a few cells cover all numbers of a range. The checks use these cells instead of
degrees. Therefore the checks need nothing of the runtime, and their findings state exactly the case in which no rule
fires.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise, product

from codra_dsl.language.check.index.parsed_rules import ParsedRule, members, range_of
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.diagnostics import Diagnostic, Related
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.fuzzy.model import And, Antecedent, Or, Proposition, Rule, Term
from codra_dsl.language.fuzzy.supports import Extent, extent
from codra_dsl.language.fuzzy.words import Hedge
from codra_dsl.language.model import Output, Variable

MAX_COMBINATIONS = 20_000
"""The maximum number of combinations of cells. An output with more combinations is not checked."""


@dataclass(frozen=True, slots=True)
class RangeCell:
    """A part of a variable's range in which each term holds either for all numbers or for no number.

    Attributes:
        active_terms: the terms with a degree above 0 on the cell.
        full_terms: the terms with degree 1 on the cell.
        numbers_text: the numbers of the cell, as text for messages.
        is_point: whether the cell is a single number of a wider range.
    """

    active_terms: frozenset[str]
    full_terms: frozenset[str]
    numbers_text: str
    is_point: bool = False


def range_cells(variable: Variable, terms: tuple[Term, ...]) -> tuple[RangeCell, ...]:
    """Return all cells of a variable with a range."""
    extents = {term.name: extent(term) for term in terms}
    if members(variable):
        return tuple(_range_cell(float(index), extents, name) for index, name in enumerate(members(variable)))
    low, high = range_of(variable) or (0.0, 0.0)
    inner_ends = {end for term_extent in extents.values() for end in term_extent.ends if low < end < high}
    ends = (low, *sorted(inner_ends), high)
    unit_text = f" {variable.type.unit}" if variable.type.unit else ""
    cells_of_range = [_range_cell(low, extents, f"{low:g}{unit_text}", is_point=low < high)]
    for left_end, right_end in pairwise(ends):
        if left_end < right_end:
            numbers_text = f"from {left_end:g}{unit_text} to {right_end:g}{unit_text}"
            cells_of_range += [_range_cell((left_end + right_end) / 2.0, extents, numbers_text)]
            cells_of_range += [_range_cell(right_end, extents, f"{right_end:g}{unit_text}", is_point=True)]
    return tuple(cells_of_range)


def _range_cell(
    number: float, extents: Mapping[str, Extent], numbers_text: str, *, is_point: bool = False
) -> RangeCell:
    active_terms = frozenset(name for name, term_extent in extents.items() if term_extent.holds(number))
    full_terms = frozenset(name for name, term_extent in extents.items() if term_extent.is_full_at(number))
    return RangeCell(active_terms, full_terms, numbers_text, is_point)


Combination = Mapping[str, RangeCell]
"""A mapping from the name of each variable to one cell of the variable."""


def can_fire(antecedent: Antecedent, combination: Combination) -> bool:
    """Return whether an antecedent holds to a degree above 0.

    A norm must be above 0 if both of its operands are above 0.
    """
    if isinstance(antecedent, And):
        return can_fire(antecedent.left, combination) and can_fire(antecedent.right, combination)
    if isinstance(antecedent, Or):
        return can_fire(antecedent.left, combination) or can_fire(antecedent.right, combination)
    if Hedge.ANY in antecedent.hedges:
        return True
    cell = combination[antecedent.variable]
    negation_count = antecedent.hedges.count(Hedge.NOT)
    if negation_count > 1:
        return True  # rare; True never causes a wrong finding
    return antecedent.term in cell.active_terms if negation_count == 0 else antecedent.term not in cell.full_terms


def uncovered_ranges(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """If a number has several terms, the terms together cover its range. Each term holds somewhere in the range."""
    for variable in spec_index.spec.context:
        is_readable = faults.is_sound("context", variable.name) and spec_index.is_readable(
            "context", variable.name, "terms", "range"
        )
        if not variable.terms or variable.is_derived or not is_readable or variable.type.range is None:
            continue
        variable_cells = range_cells(variable, spec_index.parsed_rules.terms(variable))
        place, path = variable.places.get("terms", variable.place), f"context.{variable.name}.terms"
        for term in variable.terms:
            if not any(term.name in cell.active_terms for cell in variable_cells):
                message = f"term '{term.name}' holds nowhere in the range of '{variable.name}'"
                help = "correct the parameters of the term, or remove the term"
                yield finding("uncovered-range", message, term.place, path=f"{path}.{term.name}", help=help)
        uncovered_cell = next((cell for cell in variable_cells if not cell.active_terms and not cell.is_point), None)
        if uncovered_cell is not None and len(variable.terms) > 1:
            message = f"no term of '{variable.name}' holds {uncovered_cell.numbers_text}"
            yield finding("uncovered-range", message, place, path=path, help="let neighbouring terms overlap")


def idle_rules(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Every rule can fire, and in every case some rule fires."""
    for section, output in spec_index.parsed_rules.outputs:
        parsed_rules = spec_index.parsed_rules.rules[section, output.name]
        rules = [parsed_rule.rule for parsed_rule in parsed_rules if parsed_rule.rule is not None]
        combinations = _all_combinations(spec_index, faults, section, output)
        if combinations:
            yield from _never_firing_findings(section, output, parsed_rules, combinations)
            yield from _silent_combination_findings(section, output, rules, combinations)


def silent_combinations(
    spec_index: SpecIndex, faults: FaultyElements, section: str, output: Output
) -> list[Combination]:
    """Return the combinations of cells in which no rule of an output fires; [] if this cannot be checked."""
    parsed_rules = spec_index.parsed_rules.rules[section, output.name]
    rules = [parsed_rule.rule for parsed_rule in parsed_rules if parsed_rule.rule is not None]
    return _silent_combinations(rules, _all_combinations(spec_index, faults, section, output))


def _all_combinations(spec_index: SpecIndex, faults: FaultyElements, section: str, output: Output) -> list[Combination]:
    """Return the combinations of cells of all inputs of an output; [] if its rules cannot be checked."""
    parsed_rules = spec_index.parsed_rules.rules[section, output.name]
    is_parsed = all(parsed_rule.rule is not None and not parsed_rule.problems for parsed_rule in parsed_rules)
    is_readable = is_parsed and spec_index.is_readable(section, output.name, "rules")
    if not parsed_rules or not is_readable or not faults.is_sound(section, output.name):
        return []
    return list(_combinations(spec_index, faults, spec_index.parsed_rules.input_names(section, output.name)))


_VARIABLE_KEYS = ("type", "range", "values", "terms")


def _combinations(spec_index: SpecIndex, faults: FaultyElements, names: tuple[str, ...]) -> Iterator[Combination]:
    variables = [spec_index.parsed_rules.variables[name] for name in names]
    if any(range_of(variable) is None or not faults.is_sound("context", variable.name) for variable in variables):
        return
    if not all(spec_index.is_readable("context", name, *_VARIABLE_KEYS) for name in names):
        return
    cells_of_variables = [range_cells(variable, spec_index.parsed_rules.terms(variable)) for variable in variables]
    combination_count = 1
    for variable_cells in cells_of_variables:
        combination_count *= len(variable_cells)
    if combination_count <= MAX_COMBINATIONS:
        yield from (dict(zip(names, combination, strict=True)) for combination in product(*cells_of_variables))


def _never_firing_findings(
    section: str, output: Output, parsed_rules: tuple[ParsedRule, ...], combinations: list[Combination]
) -> Iterator[Diagnostic]:
    for number, parsed_rule in enumerate(parsed_rules):
        if parsed_rule.rule is None:
            continue
        if parsed_rule.rule.weight == 0.0:
            reason = "its weight is 0"
        elif not any(can_fire(parsed_rule.rule.antecedent, combination) for combination in combinations):
            reason = "its condition never holds"
        else:
            continue
        message = f"this rule of '{output.name}' never fires: {reason}"
        path = f"{section}.{output.name}.rules.{number}"
        yield finding("idle-fuzzy-rule", message, parsed_rule.phrase.place, path=path, help="correct it, or remove it")


def _silent_combination_findings(
    section: str, output: Output, rules: list[Rule], combinations: list[Combination]
) -> Iterator[Diagnostic]:
    silent = _silent_combinations(rules, combinations)
    if silent:
        case_text = " and ".join(f"{name} is {cell.numbers_text}" for name, cell in silent[0].items())
        other_cases_text = f", and in {len(silent) - 1} more cases" if len(silent) > 1 else ""
        message = f"no rule of '{output.name}' fires if {case_text}{other_cases_text}"
        place = output.places.get("rules", output.place)
        help = "add a rule for this case: without a rule, the output is unknown"
        yield finding("silent-combination", message, place, path=f"{section}.{output.name}.rules", help=help)


def _silent_combinations(rules: list[Rule], combinations: list[Combination]) -> list[Combination]:
    return [
        combination
        for combination in combinations
        if not any(cell.is_point for cell in combination.values())
        and not any(rule.weight > 0.0 and can_fire(rule.antecedent, combination) for rule in rules)
    ]


def contradictory_rules(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """No two rules of an output have the same condition."""
    for section, output in spec_index.parsed_rules.outputs:
        first_rules: dict[object, ParsedRule] = {}
        for number, parsed_rule in enumerate(spec_index.parsed_rules.rules[section, output.name]):
            if parsed_rule.rule is None:
                continue
            other = first_rules.setdefault(_antecedent_key(parsed_rule.rule.antecedent), parsed_rule)
            if other is parsed_rule or other.rule is None:
                continue
            is_repetition = other.rule.conclusions == parsed_rule.rule.conclusions
            relation_text = "repeats another rule" if is_repetition else "contradicts another rule"
            message = f"this rule of '{output.name}' {relation_text}: both have the same condition"
            path = f"{section}.{output.name}.rules.{number}"
            related = (Related("the other rule", other.phrase.place),)
            help = "remove one of them" if is_repetition else "remove one of them, or change a condition"
            yield finding(
                "contradictory-fuzzy-rule", message, parsed_rule.phrase.place, path=path, help=help, related=related
            )


def _antecedent_key(antecedent: Antecedent) -> object:
    """Return a key of an antecedent that ignores the order of operands of the same operator."""
    if isinstance(antecedent, Proposition):
        return antecedent
    operator_type = type(antecedent)
    operand_keys: set[object] = set()
    pending_operands: list[Antecedent] = [antecedent]
    while pending_operands:
        operand = pending_operands.pop()
        if isinstance(operand, operator_type) and not isinstance(operand, Proposition):
            pending_operands += [operand.left, operand.right]
        else:
            operand_keys.add(_antecedent_key(operand))
    return operator_type, frozenset(operand_keys)


FIRING_CHECKS = (uncovered_ranges, idle_rules, contradictory_rules)
"""The checks of this module."""
