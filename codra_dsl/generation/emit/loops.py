"""Write the modules of a spec's loops: its fuzzy engines, its trees, and the declarations that connect them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from codra_dsl.generation.build_plan import BuildPlan
from codra_dsl.generation.build_plan.names import ACTION_ENGINE, MAPE_MODULE, METRIC_ENGINE, tree_module_name
from codra_dsl.generation.emit.behaviour_trees import tree_module
from codra_dsl.generation.emit.conditions import condition_with_words
from codra_dsl.generation.emit.declarations import non_default_fields, tuple_of_names
from codra_dsl.generation.emit.imports import Imports
from codra_dsl.generation.emit.layout import (
    WIDTH,
    Expression,
    call,
    dictionary,
    lay_out,
    spread_call,
    spread_tuple,
    tuple_of,
)
from codra_dsl.generation.emit.literals import literal, text_literal
from codra_dsl.generation.emit.rendering import made_by_line, render
from codra_dsl.language.check.checked.loops import (
    CheckedAdaptation,
    CheckedInput,
    CheckedLoop,
    CheckedMape,
    CheckedRate,
    CheckedStage,
    CheckedTree,
)
from codra_dsl.language.fuzzy import compile_engine
from codra_dsl.language.fuzzy.dialects import NUMBERS
from codra_dsl.language.fuzzy.model import Term, propositions
from codra_dsl.language.fuzzy.shapes import membership
from codra_dsl.language.model import Course, HardRule, Kind, Parameter, RateKind, Repeat, Worse, filtered_weight_name

MAPE_DEFAULTS: Mapping[str, Mapping[str, Expression]] = {
    "CourseModel": {
        "smooth_s": "0.0",
        "lead": "0.0",
        "hold_s": "0.0",
        "holds_s": "{}",
        "dwell_s": "0.0",
        "cooldown_s": "0.0",
        "abort_s": "2.0",
        "always": "()",
        "filtered_weights": "{}",
    },
    "HardRuleModel": {"for_s": "0.0"},
    "InputModel": {"members": "()", "terms": "{}"},
    "LoopModel": {"rates": "()", "analyse": "()", "adapt": "()", "execute": "()", "period_s": "1.0"},
    "MapeModel": {
        "metrics": "None",
        "actions": "None",
        "rates": "()",
        "courses": "()",
        "parameters": "()",
        "trees": "()",
    },
    "OutputModel": {"worse": "End.LOW"},
    "ParameterModel": {"otherwise": "None", "dwell_s": "0.0"},
    "RateModel": {"factor": "1.0", "kind": "RateKind.RATE", "valid_for_s": "math.inf"},
    "StageModel": {},
    "StageRuleModel": {},
    "TreeModel": {
        "course": '""',
        "entry": '"course"',
        "branches": "{}",
        "tasks": "()",
        "agent": '""',
        "period_s": "0.1",
        "repeat": "Repeat.ALWAYS",
    },
}
"""The runtime's default values for loops. Generated code leaves out a field that has its default value."""


def mape_texts(plan: BuildPlan, mape: CheckedMape) -> Iterator[tuple[str, str]]:
    """Yield the path and the text of each module of a spec's loops."""
    for module, stage in ((METRIC_ENGINE, mape.metrics), (ACTION_ENGINE, mape.actions)):
        if stage is not None:
            yield f"{module}.py", compile_engine(stage.engine)
    for tree in mape.trees:
        yield f"{tree_module_name(tree.name)}.py", tree_module(tree.forest)
    yield f"{MAPE_MODULE}.py", _mape_text(plan, mape)


def _mape_text(plan: BuildPlan, mape: CheckedMape) -> str:
    imports = Imports()
    imports.use("MapeModel")
    writer = _Writer(imports)
    courses = [adaptation for adaptation in mape.adaptation if isinstance(adaptation.adaptation.does, Course)]
    parameters = [adaptation for adaptation in mape.adaptation if isinstance(adaptation.adaptation.does, Parameter)]
    fields = writer.fields(
        "MapeModel",
        loops=spread_tuple(map(writer.loop, mape.loops)),
        metrics=writer.stage(METRIC_ENGINE, mape.metrics),
        actions=writer.stage(ACTION_ENGINE, mape.actions),
        rates=_tuple_of_declarations(map(writer.rate, mape.rates)),
        courses=_tuple_of_declarations(map(writer.course, courses)),
        parameters=_tuple_of_declarations(map(writer.parameter, parameters)),
        trees=_tuple_of_declarations(map(writer.tree, mape.trees)),
    )
    return render(
        "mape.py.j2",
        title=f"The loops of '{plan.name}': what they analyse, choose and execute.",
        made_by=made_by_line(plan),
        imports=imports.lines(),
        modules=_local_imports(mape),
        model=lay_out(spread_call("MapeModel", **fields), before=len("MAPE = ")),
    )


def _tuple_of_declarations(declarations: Iterable[Expression]) -> Expression:
    items = list(declarations)
    return spread_tuple(items) if items else "()"


def _local_imports(mape: CheckedMape) -> str:
    modules = [METRIC_ENGINE] if mape.metrics is not None else []
    modules += [ACTION_ENGINE] if mape.actions is not None else []
    modules += [tree_module_name(tree.name) for tree in mape.trees]
    if not modules:
        return ""
    flat = f"from . import {', '.join(sorted(modules))}"
    return flat if len(flat) <= WIDTH else f"from . import {lay_out(spread_tuple(sorted(modules)))}"


class _Writer:
    """Writes the declarations of one spec. Each public method except `fields` returns one declaration."""

    def __init__(self, imports: Imports) -> None:
        self._imports = imports

    def fields(self, model: str, **fields: Expression) -> dict[str, Expression]:
        """Return the fields of a model that differ from their defaults."""
        return non_default_fields(model, MAPE_DEFAULTS[model], self._imports, fields)

    def loop(self, checked: CheckedLoop) -> Expression:
        """Return the declaration of a loop."""
        loop = checked.loop
        fields = self.fields(
            "LoopModel",
            name=literal(loop.name),
            rates=tuple_of_names(checked.rates),
            analyse=tuple_of_names(reference.name for reference in loop.analyse),
            adapt=tuple_of_names(reference.name for reference in loop.adapt),
            execute=tuple_of_names(reference.name for reference in loop.execute),
            period_s=literal(loop.period_s),
        )
        return call("LoopModel", **fields)

    def stage(self, module: str, stage: CheckedStage | None) -> Expression:
        """Return the declaration of a stage: an engine and its variables; `None` without a stage."""
        if stage is None:
            return "None"
        rules = [rule for block in stage.engine.blocks for rule in block.rules]
        variables_of_rules = [
            tuple(dict.fromkeys(proposition.variable for proposition in propositions(rule.antecedent)))
            for rule in rules
        ]
        fields = self.fields(
            "StageModel",
            infer=f"{module}.infer",
            infer_bounds=f"{module}.infer_bounds",
            inputs=spread_tuple(map(self._input, stage.inputs)),
            outputs=spread_tuple(
                self._output(output.output.name, output.variable, output.output.worse) for output in stage.outputs
            ),
            rules=spread_tuple(
                call(
                    "StageRuleModel",
                    **self.fields(
                        "StageRuleModel",
                        text=literal(rule.text),
                        concludes=tuple_of_names([rule.output]),
                        reads=tuple_of_names(read_variables),
                    ),
                )
                for rule, read_variables in zip(stage.rules, variables_of_rules, strict=True)
            ),
        )
        return spread_call("StageModel", **fields)

    def _input(self, checked_input: CheckedInput) -> Expression:
        self._imports.use("Bounds")
        is_discrete = checked_input.variable.type.kind in (Kind.BOOL, Kind.ENUM)
        terms = {literal(term.name): self._membership(term) for term in checked_input.terms}
        fields = self.fields(
            "InputModel",
            variable=literal(checked_input.variable.name),
            range=call("Bounds", literal(float(checked_input.minimum)), literal(float(checked_input.maximum))),
            members=tuple_of_names(checked_input.members) if is_discrete else "()",
            terms=dictionary(terms),
        )
        return call("InputModel", **fields)

    def _membership(self, term: Term) -> Expression:
        self._imports.use("terms")
        return f"lambda x: {membership(term, 'x', {}, [], NUMBERS)}"

    def _output(self, name: str, variable: str, worse: Worse) -> Expression:
        self._imports.use(*(["End"] if worse is Worse.HIGH else []))
        fields = self.fields("OutputModel", name=literal(name), variable=literal(variable), worse=f"End.{worse.name}")
        return call("OutputModel", **fields)

    def rate(self, rate: CheckedRate) -> Expression:
        """Return the declaration of a rate."""
        self._imports.use(*(["RateKind"] if rate.kind is not RateKind.RATE else []))
        fields = self.fields(
            "RateModel",
            variable=literal(rate.variable.name),
            of=literal(rate.of),
            over_s=literal(rate.over_s),
            factor=literal(rate.factor),
            kind=f"RateKind.{rate.kind.name}",
            valid_for_s=literal(rate.variable.valid_for_s),
        )
        return call("RateModel", **fields)

    def course(self, checked: CheckedAdaptation) -> Expression:
        """Return the declaration of a course, the choice among actions."""
        adaptation, course = checked.adaptation, checked.adaptation.does
        assert isinstance(course, Course)
        rules = (self._hard_rule(rule, python) for rule, python in zip(course.always, checked.python, strict=True))
        fields = self.fields(
            "CourseModel",
            name=literal(adaptation.name),
            choose=tuple_of_names(action.name for action in course.choose),
            otherwise=literal(course.otherwise.name),
            variable=literal(adaptation.name),
            smooth_s=literal(course.smooth_s),
            lead=literal(course.lead),
            hold_s=literal(course.hold_s),
            holds_s=dictionary({literal(action): literal(hold_s) for action, hold_s in checked.holds_s.items()}),
            dwell_s=literal(adaptation.dwell_s),
            cooldown_s=literal(course.cooldown_s),
            abort_s=literal(course.abort_s),
            always=tuple_of(rules),
            filtered_weights=dictionary(
                {literal(action.name): literal(filtered_weight_name(action.name)) for action in course.choose}
                if course.node is not None
                else {}
            ),
        )
        return call("CourseModel", **fields)

    def _hard_rule(self, rule: HardRule, python: str) -> Expression:
        condition_expression, words = condition_with_words(python)
        self._imports.use(*words)
        fields = self.fields(
            "HardRuleModel",
            condition=condition_expression,
            action=literal(rule.action.name),
            text=literal(rule.condition.text),
            for_s=literal(rule.for_s),
        )
        return call("HardRuleModel", **fields)

    def parameter(self, checked: CheckedAdaptation) -> Expression:
        """Return the declaration of a parameter, a variable that is set."""
        adaptation, parameter = checked.adaptation, checked.adaptation.does
        assert isinstance(parameter, Parameter)
        expressions = []
        for python in checked.python:
            expression, words = condition_with_words(python)
            self._imports.use(*words)
            expressions.append(expression)
        value, otherwise, *_ = (*expressions, "None")
        fields = self.fields(
            "ParameterModel",
            name=literal(adaptation.name),
            variable=literal(parameter.variable.name),
            value=value,
            text=literal(parameter.value.text),
            otherwise=otherwise,
            dwell_s=literal(adaptation.dwell_s),
        )
        return call("ParameterModel", **fields)

    def tree(self, tree: CheckedTree) -> Expression:
        """Return the declaration of a tree with its branches."""
        element = tree.element
        self._imports.use(*(["Repeat"] if element.repeat is Repeat.ON_SWITCH else []))
        module, main = tree_module_name(tree.name), tree.forest.forest.main or ""
        fields = self.fields(
            "TreeModel",
            name=literal(tree.name),
            build=f"{module}.TREES[{text_literal(main)}]",
            course=literal(tree.course),
            entry=literal(tree.entry),
            branches=dictionary({text_literal(action): literal(value) for action, value in tree.branches.items()}),
            tasks=tuple_of_names(tree.tasks),
            agent=literal("" if element.agent is None else element.agent.name),
            period_s=literal(element.period_s),
            repeat=f"Repeat.{element.repeat.name}",
        )
        return call("TreeModel", **fields)
