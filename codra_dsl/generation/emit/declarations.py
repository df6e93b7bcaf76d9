"""The declarations in generated modules, in the words of `codra_dsl.runtime.values.model`."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from codra_dsl.generation.build_plan import Branch, Tree
from codra_dsl.generation.emit.conditions import condition
from codra_dsl.generation.emit.imports import Imports
from codra_dsl.generation.emit.layout import Expression, call, dictionary, spread_call, tuple_of
from codra_dsl.generation.emit.literals import literal, text_literal
from codra_dsl.language.check.checked.spec import CheckedExpectation
from codra_dsl.language.model import ALGORITHM_SETTINGS, Access, Kind, Resource, Returned, Skill, ValueType, Variable

DEFAULTS: Mapping[str, Mapping[str, Expression]] = {
    "Algorithm": {
        "parameters": "{}",
        "handles": "()",
        "slots": "()",
        "given": "()",
        "returns": "{}",
        **{setting.field_name: literal(setting.default) for setting in ALGORITHM_SETTINGS},
    },
    "ObserverModel": {"period_s": "1.0", "priority": "0"},
    "ResourceModel": {"slots": "None"},
    "SkillModel": {"preview": "()", "monitor": "()", "changes": "()", "expects": "()"},
    "ExpectationModel": {"within_s": "math.inf"},
    "VariableModel": {
        "label": '""',
        "sources": '("observer",)',
        "valid_for_s": "math.inf",
        "when_unobservable": '"keep"',
        "refresh": '"periodic"',
        "history": "100",
        "pose_condition": "None",
    },
}
"""The defaults of the runtime, which generated code leaves out."""

_TYPES: Mapping[Kind, str] = {
    Kind.BOOL: "boolean",
    Kind.INT: "integer",
    Kind.FLOAT: "real",
    Kind.STR: "text",
    Kind.ENUM: "member",
}


def algorithm(branch: Branch, imports: Imports) -> Expression:
    """Return the declaration of a perception algorithm."""
    declared = branch.algorithm.algorithm
    fields = _non_default(
        "Algorithm",
        imports,
        name=literal(declared.name),
        call=literal(declared.call),
        parameters=dictionary({text_literal(name): literal(value) for name, value in declared.parameters}),
        handles=names(usage.resource.name for usage in declared.uses if usage.access is Access.READ),
        slots=names(usage.resource.name for usage in declared.uses if usage.access is Access.SLOT),
        given=names(reference.name for reference in declared.given),
        returns=dictionary(
            {text_literal(returned.name): _returned(returned, imports) for returned in declared.returns}
        ),
        **{setting.field_name: literal(getattr(declared, setting.field_name)) for setting in ALGORITHM_SETTINGS},
    )
    return spread_call("Algorithm", **fields)


def variable(declared: Variable, poses: Mapping[str, str], imports: Imports) -> Expression:
    """Return the declaration of a context-variable; `poses` has the comparisons of those derived from poses."""
    pose_condition, words = (
        condition(poses[declared.name]) if declared.pose_condition is not None else ("None", frozenset[str]())
    )
    imports.use(*words)
    fields = _non_default(
        "VariableModel",
        imports,
        name=literal(declared.name),
        type=value_type(declared.type, imports),
        label=literal(declared.label if declared.label != declared.name else ""),
        sources=names([reference.name for reference in declared.sources] or ["observer"]),
        valid_for_s=literal(declared.valid_for_s),
        when_unobservable=text_literal(declared.when_unobservable),
        refresh=text_literal(declared.refresh),
        history=literal(declared.history),
        pose_condition=pose_condition,
    )
    return call("VariableModel", **fields)


def observer(tree: Tree, imports: Imports) -> Expression:
    """Return the declaration of an observer."""
    fields = _non_default(
        "ObserverModel",
        imports,
        name=literal(tree.name),
        identifies=names(tree.identifies),
        build=tree.function,
        period_s=literal(tree.period_s),
        priority=literal(tree.priority),
    )
    return call("ObserverModel", **fields)


def skill(declared: Skill, expectations: Iterable[CheckedExpectation], imports: Imports) -> Expression:
    """Return the declaration of a skill."""
    fields = _non_default(
        "SkillModel",
        imports,
        name=literal(declared.name),
        preview=names(reference.name for reference in declared.preview),
        monitor=names(expectation.variable.name for expectation in declared.monitor),
        changes=names(reference.name for reference in declared.changes),
        expects=tuple_of(_expectation(expectation, imports) for expectation in expectations),
    )
    return call("SkillModel", **fields)


def resource(declared: Resource, imports: Imports) -> Expression:
    """Return the declaration of a resource."""
    slots = "None" if declared.slots is None else literal(declared.slots)
    return call("ResourceModel", **_non_default("ResourceModel", imports, name=literal(declared.name), slots=slots))


def _expectation(expected: CheckedExpectation, imports: Imports) -> Expression:
    expression, words = condition(expected.python)
    imports.use(*words)
    within_s = literal(math.inf if expected.within_s is None else expected.within_s)
    fields = _non_default(
        "ExpectationModel", imports, text=literal(expected.text), condition=expression, within_s=within_s
    )
    return call("ExpectationModel", **fields)


def _non_default(model: str, imports: Imports, **fields: Expression) -> dict[str, Expression]:
    return non_default_fields(model, DEFAULTS[model], imports, fields)


def non_default_fields(
    model: str, defaults: Mapping[str, Expression], imports: Imports, fields: Mapping[str, Expression]
) -> dict[str, Expression]:
    """Return the fields that differ from the defaults of the runtime, and record their imports."""
    imports.use(model)
    given = {
        name: value for name, value in fields.items() if name not in defaults or _on_one_line(value) != defaults[name]
    }
    imports.use_math_for(given.values())
    return given


def _on_one_line(value: Expression) -> str | None:
    return value if isinstance(value, str) else value.flat


def names(several: Iterable[str]) -> Expression:
    """Return a tuple of names without duplicates."""
    return tuple_of(text_literal(name) for name in dict.fromkeys(several))


def _returned(returned: Returned, imports: Imports) -> Expression:
    return (
        value_type(returned.type, imports, optional="True") if returned.optional else value_type(returned.type, imports)
    )


def value_type(declared: ValueType, imports: Imports, **optional: Expression) -> Expression:
    """Return the type of a value; the bounds of an integer are integers."""
    function = _TYPES[declared.kind]
    imports.use(function)
    bounds = declared.range if declared.range is not None else ()
    has_integer_bounds = declared.kind is Kind.INT and all(map(math.isfinite, bounds))
    arguments = [literal(int(bound) if has_integer_bounds else bound) for bound in bounds]
    imports.use_math_for(arguments)
    unit = {"unit": literal(declared.unit)} if declared.unit is not None else {}
    return call(function, *arguments, *map(text_literal, declared.values), **unit, **optional)
