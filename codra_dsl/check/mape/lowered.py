"""The making of `CheckedMape`: engines out of rules, conditions in the words of the runtime."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from codra_dsl.check.mape.book import RuleBook, defuzzifier_of, members, output_terms, range_of
from codra_dsl.check.mape.branches import chosen_values
from codra_dsl.check.mape.checked import (
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
from codra_dsl.check.mape.inputs import rate_factor
from codra_dsl.check.scope import Scope
from codra_dsl.fuzzy.model import (
    Activation,
    Defuzzifier,
    Engine,
    InputVariable,
    OutputVariable,
    Proposition,
    Rule,
    RuleBlock,
)
from codra_dsl.fuzzy.words import Method
from codra_dsl.fuzzy.write import rule_text
from codra_dsl.model import Adaptation, Course, Loop, Output, Parameter, TreeElement, Variable, weight_name


def checked_mape(scope: Scope) -> CheckedMape | None:
    """Return the loops of a sound spec; None where it says nothing of them."""
    spec = scope.spec
    if not spec.adapts:
        return None
    return CheckedMape(
        metrics=_stage(scope.book, "metrics", spec.metrics),
        actions=_stage(scope.book, "actions", spec.actions),
        rates=tuple(_rate(scope, variable) for variable in spec.context if variable.rate is not None),
        adaptation=tuple(_adaptation(scope, each) for each in spec.adaptation),
        trees=tuple(_tree(scope, each) for each in spec.trees),
        loops=tuple(_loop(scope, each) for each in spec.loops),
    )


def _stage(book: RuleBook, section: str, outputs: tuple[Output, ...]) -> CheckedStage | None:
    if not outputs:
        return None
    names = dict.fromkeys(name for output in outputs for name in book.named(section, output.name))
    inputs = tuple(_input(book, book.variables[name]) for name in names)
    told = tuple(
        CheckedOutput(output=each, variable=each.name if section == "metrics" else weight_name(each.name))
        for each in outputs
    )
    blocks = tuple(_block(book, section, each) for each in told)
    engine = Engine(
        name=section,
        inputs=tuple(
            InputVariable(name=each.variable.name, minimum=each.minimum, maximum=each.maximum, terms=each.terms)
            for each in inputs
        ),
        outputs=tuple(map(_output, told)),
        blocks=blocks,
    )
    rules = tuple(
        CheckedFuzzyRule(text=rule_text(rule), output=each.output.name, place=phrase.place)
        for each, block in zip(told, blocks, strict=True)
        for rule, phrase in zip(block.rules, each.output.rules, strict=True)
    )
    return CheckedStage(engine=engine, inputs=inputs, outputs=told, rules=rules)


def _input(book: RuleBook, variable: Variable) -> CheckedInput:
    low, high = range_of(variable) or (0.0, 0.0)
    return CheckedInput(
        variable=variable,
        minimum=float(low),
        maximum=float(high),
        members=members(variable),
        terms=book.terms(variable),
    )


def _output(told: CheckedOutput) -> OutputVariable:
    return OutputVariable(
        name=told.variable,
        minimum=0.0,
        maximum=1.0,
        is_locked=True,
        aggregation=told.output.method.aggregation,
        defuzzifier=Defuzzifier(method=defuzzifier_of(told.output)),
        terms=output_terms(told.output),
    )


def _block(book: RuleBook, section: str, told: CheckedOutput) -> RuleBlock:
    method = told.output.method
    rules = (each.rule for each in book.rules[section, told.output.name])
    return RuleBlock(
        name=told.output.name,
        conjunction=method.conjunction,
        disjunction=method.disjunction,
        implication=method.implication,
        activation=Activation(method=Method.GENERAL),
        rules=tuple(_about(rule, told.variable) for rule in rules if rule is not None),
    )


def _about(rule: Rule, variable: str) -> Rule:
    concluded: tuple[Proposition, ...] = tuple(replace(each, variable=variable) for each in rule.conclusions)
    return replace(rule, conclusions=concluded)


def _rate(scope: Scope, variable: Variable) -> CheckedRate:
    assert variable.rate is not None
    of = scope.variables[variable.rate.of.name]
    factor = rate_factor(variable, of)
    assert factor is not None
    return CheckedRate(variable=variable, of=of.name, over_s=variable.rate.over_s, factor=factor)


def _adaptation(scope: Scope, adaptation: Adaptation) -> CheckedAdaptation:
    does = adaptation.does
    if isinstance(does, Parameter):
        python: tuple[str, ...] = (scope.python(does.value, scope.context_types[does.variable.name]),)
    else:
        python = tuple(scope.python(rule.condition, None) for rule in does.always)
    own = (site for site in scope.sites if site.owner == ("adaptation", adaptation.name))
    reads = sorted({each.name for site in own for each in site.names})
    return CheckedAdaptation(adaptation=adaptation, python=python, reads=tuple(reads))


def _tree(scope: Scope, tree: TreeElement) -> CheckedTree:
    forest = scope.forests[tree.name][0]
    assert forest is not None
    entry, values = chosen_values(tree, forest.forest)
    courses = (each.name for each in scope.spec.adaptation if _is_course_of(each, tree.name))
    tasks = dict.fromkeys(task.name for leaf in tree.leaves for task in leaf.tasks)
    return CheckedTree(
        element=tree, forest=forest, course=next(courses, ""), entry=entry, branches=values, tasks=tuple(tasks)
    )


def _is_course_of(adaptation: Adaptation, tree: str) -> bool:
    return isinstance(adaptation.does, Course) and adaptation.does.within.name == tree


def _loop(scope: Scope, loop: Loop) -> CheckedLoop:
    """Return a loop with the rates that its rules and conditions read, and those that nobody reads with the first."""
    claimed = {each.name: tuple(_rates(scope, each)) for each in scope.spec.loops}
    owners: dict[str, str] = {}
    for owner, rates in claimed.items():
        for rate in rates:
            owners.setdefault(rate, owner)
    for variable in scope.spec.context:
        if variable.rate is not None:
            owners.setdefault(variable.name, scope.spec.loops[0].name)
    return CheckedLoop(loop=loop, rates=tuple(rate for rate in sorted(owners) if owners[rate] == loop.name))


def _rates(scope: Scope, loop: Loop) -> Iterator[str]:
    names = {name for each in loop.analyse for name in scope.book.named("metrics", each.name)}
    for adaptation in scope.spec.adaptation:
        if adaptation.name in (each.name for each in loop.adapt):
            does = adaptation.does
            actions = [each.name for each in does.choose] if isinstance(does, Course) else []
            names |= {name for action in actions for name in scope.book.named("actions", action)}
            names |= {
                each.name
                for site in scope.sites
                if site.owner == ("adaptation", adaptation.name)
                for each in site.names
            }
    for name in sorted(names):
        variable = scope.variables.get(name)
        if variable is not None and variable.rate is not None:
            yield name
