"""The construction of `CheckedMape`: fuzzy engines that are made from rules, and conditions as Python text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from codra_dsl.language.check.checked.loops import (
    CheckedAdaptation,
    CheckedFuzzyRule,
    CheckedInput,
    CheckedLoop,
    CheckedMape,
    CheckedOutput,
    CheckedRate,
    CheckedStage,
    CheckedTree,
)
from codra_dsl.language.check.conditions.conditions import LOOP_ROLES
from codra_dsl.language.check.index.parsed_rules import ParsedRules, defuzzifier_of, members, output_terms, range_of
from codra_dsl.language.check.index.spec_index import SpecIndex
from codra_dsl.language.check.loops.branches import chosen_values
from codra_dsl.language.check.loops.inputs import rate_factor
from codra_dsl.language.fuzzy.model import (
    Activation,
    Defuzzifier,
    Engine,
    InputVariable,
    OutputVariable,
    Proposition,
    Rule,
    RuleBlock,
)
from codra_dsl.language.fuzzy.words import Method
from codra_dsl.language.fuzzy.write import rule_text
from codra_dsl.language.model import Adaptation, Course, Output, Parameter, Spec, TreeElement, Variable, weight_name


def checked_mape(spec_index: SpecIndex) -> CheckedMape | None:
    """Return the loops of a sound spec; None if the spec declares no loops."""
    spec = spec_index.spec
    if not spec.adapts:
        return None
    reads = _reads(spec_index)
    own_holds_s = {action.name: action.hold_s for action in spec.actions if action.hold_s is not None}
    rates, courses = _rates_by_loop(spec_index, reads), _courses_by_tree(spec)
    return CheckedMape(
        metrics=_stage(spec_index.parsed_rules, "metrics", spec.metrics),
        actions=_stage(spec_index.parsed_rules, "actions", spec.actions),
        rates=tuple(_rate(spec_index, variable) for variable in spec.context if variable.rate is not None),
        adaptation=tuple(
            _adaptation(spec_index, adaptation, reads[adaptation.name], own_holds_s) for adaptation in spec.adaptation
        ),
        trees=tuple(_tree(spec_index, tree, courses.get(tree.name, "")) for tree in spec.trees),
        loops=tuple(CheckedLoop(loop=loop, rates=tuple(sorted(rates[loop.name]))) for loop in spec.loops),
    )


def _reads(spec_index: SpecIndex) -> Mapping[str, tuple[str, ...]]:
    """Return, for each adaptation, the context-variables that its conditions or its value read, sorted."""
    names: dict[str, set[str]] = {adaptation.name: set() for adaptation in spec_index.spec.adaptation}
    for site in spec_index.sites:
        if site.role in LOOP_ROLES:
            names[site.owner[1]].update(read_name.name for read_name in site.names)
    return {name: tuple(sorted(read_names)) for name, read_names in names.items()}


def _rates_by_loop(spec_index: SpecIndex, reads: Mapping[str, Sequence[str]]) -> Mapping[str, Sequence[str]]:
    """Return, for each loop, the rates that it computes.

    A rate belongs to the first loop with a rule or a condition that reads the rate. Rates that no loop reads belong to
    the first loop of the spec.
    """
    spec = spec_index.spec
    courses = {adaptation.name: adaptation.does for adaptation in spec.adaptation}
    owners: dict[str, str] = {}
    for loop in spec.loops:
        keys = [("metrics", metric.name) for metric in loop.analyse]
        for adaptation in loop.adapt:
            does = courses[adaptation.name]
            keys += [("actions", action.name) for action in does.choose] if isinstance(does, Course) else []
            owners |= {name: loop.name for name in reads[adaptation.name] if name not in owners}
        for key in dict.fromkeys(keys):
            owners |= {name: loop.name for name in spec_index.parsed_rules.input_names(*key) if name not in owners}
    rates: dict[str, list[str]] = {loop.name: [] for loop in spec.loops}
    for variable in spec.context if spec.loops else ():
        if variable.rate is not None:
            rates[owners.get(variable.name, spec.loops[0].name)].append(variable.name)
    return rates


def _courses_by_tree(spec: Spec) -> Mapping[str, str]:
    """Return, for each tree, the adaptation that chooses its branch."""
    return {
        adaptation.does.within.name: adaptation.name
        for adaptation in reversed(spec.adaptation)
        if isinstance(adaptation.does, Course)
    }


def _stage(parsed_rules: ParsedRules, section: str, outputs: tuple[Output, ...]) -> CheckedStage | None:
    if not outputs:
        return None
    names = dict.fromkeys(name for output in outputs for name in parsed_rules.input_names(section, output.name))
    inputs = tuple(_input(parsed_rules, parsed_rules.variables[name]) for name in names)
    checked_outputs = tuple(
        CheckedOutput(output=output, variable=output.name if section == "metrics" else weight_name(output.name))
        for output in outputs
    )
    blocks = tuple(_block(parsed_rules, section, checked_output) for checked_output in checked_outputs)
    engine = Engine(
        name=section,
        inputs=tuple(
            InputVariable(
                name=checked_input.variable.name,
                minimum=checked_input.minimum,
                maximum=checked_input.maximum,
                terms=checked_input.terms,
            )
            for checked_input in inputs
        ),
        outputs=tuple(map(_output, checked_outputs)),
        blocks=blocks,
    )
    rules = tuple(
        CheckedFuzzyRule(text=rule_text(rule), output=checked_output.output.name, place=phrase.place)
        for checked_output, block in zip(checked_outputs, blocks, strict=True)
        for rule, phrase in zip(block.rules, checked_output.output.rules, strict=True)
    )
    return CheckedStage(engine=engine, inputs=inputs, outputs=checked_outputs, rules=rules)


def _input(parsed_rules: ParsedRules, variable: Variable) -> CheckedInput:
    low, high = range_of(variable) or (0.0, 0.0)
    return CheckedInput(
        variable=variable,
        minimum=float(low),
        maximum=float(high),
        members=members(variable),
        terms=parsed_rules.terms(variable),
    )


def _output(checked_output: CheckedOutput) -> OutputVariable:
    return OutputVariable(
        name=checked_output.variable,
        minimum=0.0,
        maximum=1.0,
        is_locked=True,
        aggregation=checked_output.output.method.aggregation,
        defuzzifier=Defuzzifier(method=defuzzifier_of(checked_output.output)),
        terms=output_terms(checked_output.output),
    )


def _block(parsed_rules: ParsedRules, section: str, checked_output: CheckedOutput) -> RuleBlock:
    method = checked_output.output.method
    rules = (parsed_rule.rule for parsed_rule in parsed_rules.rules[section, checked_output.output.name])
    return RuleBlock(
        name=checked_output.output.name,
        conjunction=method.conjunction,
        disjunction=method.disjunction,
        implication=method.implication,
        activation=Activation(method=Method.GENERAL),
        rules=tuple(_conclude_about(rule, checked_output.variable) for rule in rules if rule is not None),
    )


def _conclude_about(rule: Rule, variable: str) -> Rule:
    conclusions: tuple[Proposition, ...] = tuple(
        replace(conclusion, variable=variable) for conclusion in rule.conclusions
    )
    return replace(rule, conclusions=conclusions)


def _rate(spec_index: SpecIndex, variable: Variable) -> CheckedRate:
    assert variable.rate is not None
    base_variable = spec_index.variables[variable.rate.of.name]
    factor = rate_factor(variable, base_variable)
    assert factor is not None
    rate = variable.rate
    return CheckedRate(variable=variable, of=base_variable.name, over_s=rate.over_s, factor=factor, kind=rate.kind)


def _adaptation(
    spec_index: SpecIndex, adaptation: Adaptation, reads: Sequence[str], own_holds_s: Mapping[str, float]
) -> CheckedAdaptation:
    does = adaptation.does
    if isinstance(does, Parameter):
        wanted_type = spec_index.context_types[does.variable.name]
        values = (does.value,) if does.otherwise is None else (does.value, does.otherwise)
        python = tuple(spec_index.python(value, wanted_type) for value in values)
    else:
        python = tuple(spec_index.python(rule.condition, None) for rule in does.always)
    actions = [action.name for action in does.choose] if isinstance(does, Course) else []
    holds_s = {action: own_holds_s[action] for action in actions if action in own_holds_s}
    return CheckedAdaptation(adaptation=adaptation, python=python, reads=tuple(reads), holds_s=holds_s)


def _tree(spec_index: SpecIndex, tree: TreeElement, course: str) -> CheckedTree:
    forest = spec_index.forests[tree.name][0]
    assert forest is not None
    entry, values = chosen_values(tree, forest.forest)
    tasks = dict.fromkeys(task.name for leaf in tree.leaves for task in leaf.tasks)
    return CheckedTree(element=tree, forest=forest, course=course, entry=entry, branches=values, tasks=tuple(tasks))
