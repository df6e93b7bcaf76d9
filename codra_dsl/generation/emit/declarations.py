"""Write the declarations in generated modules as calls of classes of `codra_dsl.runtime.values.model`."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from functools import lru_cache

from codra_dsl.generation.build_plan import Branch, Tree
from codra_dsl.generation.emit.conditions import condition_with_words
from codra_dsl.generation.emit.imports import Imports
from codra_dsl.generation.emit.layout import Expression, call, dictionary, spread_call, tuple_of
from codra_dsl.generation.emit.literals import literal, text_literal
from codra_dsl.language.check.checked.spec import CheckedCondition, CheckedExpectation
from codra_dsl.language.model import (
    ALGORITHM_SETTINGS,
    Access,
    Handle,
    Kind,
    PoseCondition,
    Resource,
    Returned,
    Skill,
    Topic,
    ValueType,
    Variable,
)

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
    "HandleModel": {"parameters": "{}"},
    "ResourceModel": {"slots": "None", "handle": "None"},
    "SkillModel": {"preview": "()", "preview_conditions": "()", "monitor": "()", "changes": "()", "expects": "()"},
    "ExpectationModel": {"within_s": "math.inf"},
    "TopicModel": {"factor": "1.0", "qos": '"default"'},
    "VariableModel": {
        "label": '""',
        "sources": '("observer",)',
        "valid_for_s": "math.inf",
        "when_unobservable": '"keep"',
        "refresh": '"periodic"',
        "history": "100",
        "pose_condition": "None",
        "resolution_m": "None",
        "derived": "None",
        "ros": "None",
    },
}
"""The default values of the runtime. Generated code leaves out a field that has its default value."""

_TYPES: Mapping[Kind, str] = {
    Kind.BOOL: "boolean",
    Kind.INT: "integer",
    Kind.FLOAT: "real",
    Kind.STR: "text",
    Kind.ENUM: "member",
}


def algorithm_declaration(branch: Branch, imports: Imports) -> Expression:
    """Return the declaration of a perception algorithm."""
    declared_algorithm = branch.algorithm.algorithm
    fields = _fields(
        "Algorithm",
        imports,
        name=literal(declared_algorithm.name),
        call=literal(declared_algorithm.call),
        parameters=dictionary({text_literal(name): literal(value) for name, value in declared_algorithm.parameters}),
        handles=tuple_of_names(usage.resource.name for usage in declared_algorithm.uses if usage.access is Access.READ),
        slots=tuple_of_names(usage.resource.name for usage in declared_algorithm.uses if usage.access is Access.SLOT),
        given=tuple_of_names(reference.name for reference in declared_algorithm.given),
        returns=dictionary(
            {text_literal(returned.name): _result_type(returned, imports) for returned in declared_algorithm.returns}
        ),
        **{
            setting.field_name: literal(getattr(declared_algorithm, setting.field_name))
            for setting in ALGORITHM_SETTINGS
        },
    )
    return spread_call("Algorithm", **fields)


def variable_declaration(declared_variable: Variable, computed: Mapping[str, str], imports: Imports) -> Expression:
    """Return the declaration of a context-variable.

    `computed` maps the name of each variable that follows from the graph or from other variables to its expression.
    """
    expression, words = (
        condition_with_words(computed[declared_variable.name])
        if declared_variable.is_computed
        else ("None", frozenset[str]())
    )
    imports.use(*words)
    pose_condition = declared_variable.pose_condition
    fields = _fields(
        "VariableModel",
        imports,
        name=literal(declared_variable.name),
        type=value_type(declared_variable.type, imports),
        label=literal(declared_variable.label if declared_variable.label != declared_variable.name else ""),
        sources=tuple_of_names([reference.name for reference in declared_variable.sources] or ["observer"]),
        valid_for_s=literal(declared_variable.valid_for_s),
        when_unobservable=text_literal(declared_variable.when_unobservable),
        refresh=text_literal(declared_variable.refresh),
        history=literal(declared_variable.history),
        pose_condition="None" if pose_condition is None else expression,
        resolution_m=_resolution_m(pose_condition),
        derived="None" if declared_variable.derived is None else expression,
        ros="None" if declared_variable.ros is None else _topic(declared_variable.ros, imports),
    )
    return call("VariableModel", **fields)


def _topic(topic: Topic, imports: Imports) -> Expression:
    fields = _fields(
        "TopicModel",
        imports,
        topic=literal(topic.topic),
        type=literal(topic.type),
        field=literal(topic.field),
        writer=literal(topic.writer),
        factor=literal(topic.factor),
        qos=text_literal(topic.qos),
    )
    return call("TopicModel", **fields)


def _resolution_m(pose_condition: PoseCondition | None) -> Expression:
    resolution_m = None if pose_condition is None else pose_condition.resolution_m
    return "None" if resolution_m is None else literal(resolution_m)


def observer_declaration(tree: Tree, imports: Imports) -> Expression:
    """Return the declaration of an observer."""
    fields = _fields(
        "ObserverModel",
        imports,
        name=literal(tree.name),
        identifies=tuple_of_names(tree.identifies),
        build=tree.function,
        period_s=literal(tree.period_s),
        priority=literal(tree.priority),
    )
    return call("ObserverModel", **fields)


def skill_declaration(
    declared_skill: Skill,
    preview_conditions: Iterable[CheckedCondition],
    expectations: Iterable[CheckedExpectation],
    imports: Imports,
) -> Expression:
    """Return the declaration of a skill."""
    fields = _fields(
        "SkillModel",
        imports,
        name=literal(declared_skill.name),
        preview=tuple_of_names(dict.fromkeys(reference.name for reference in declared_skill.preview)),
        preview_conditions=tuple_of(_preview_condition(condition, imports) for condition in preview_conditions),
        monitor=tuple_of_names(expectation.variable.name for expectation in declared_skill.monitor),
        changes=tuple_of_names(reference.name for reference in declared_skill.changes),
        expects=tuple_of(_expectation(expectation, imports) for expectation in expectations),
    )
    return call("SkillModel", **fields)


def resource_declaration(declared_resource: Resource, handle: Handle | None, imports: Imports) -> Expression:
    """Return the declaration of a resource; `handle` is how the site makes its handle, if a site states this."""
    fields = _fields(
        "ResourceModel",
        imports,
        name=literal(declared_resource.name),
        slots="None" if declared_resource.slots is None else literal(declared_resource.slots),
        handle="None" if handle is None else _handle_declaration(handle, imports),
    )
    return call("ResourceModel", **fields)


def _handle_declaration(handle: Handle, imports: Imports) -> Expression:
    parameters = dictionary({text_literal(name): literal(value) for name, value in handle.arguments})
    return call("HandleModel", **_fields("HandleModel", imports, call=literal(handle.call), parameters=parameters))


def _preview_condition(condition: CheckedCondition, imports: Imports) -> Expression:
    expression, words = condition_with_words(condition.python)
    imports.use("PreviewCondition", *words)
    return call("PreviewCondition", text=literal(condition.text), condition=expression)


def _expectation(expectation: CheckedExpectation, imports: Imports) -> Expression:
    expression, words = condition_with_words(expectation.python)
    imports.use(*words)
    within_s = literal(math.inf if expectation.within_s is None else expectation.within_s)
    fields = _fields(
        "ExpectationModel", imports, text=literal(expectation.text), condition=expression, within_s=within_s
    )
    return call("ExpectationModel", **fields)


def _fields(model: str, imports: Imports, **fields: Expression) -> dict[str, Expression]:
    return non_default_fields(model, DEFAULTS[model], imports, fields)


def non_default_fields(
    model: str, defaults: Mapping[str, Expression], imports: Imports, fields: Mapping[str, Expression]
) -> dict[str, Expression]:
    """Return the fields that differ from the defaults of the runtime, and record the imports of these fields."""
    imports.use(model)
    kept_fields = {
        name: value
        for name, value in fields.items()
        if name not in defaults or (value if isinstance(value, str) else value.flat) != defaults[name]
    }
    imports.use_math_for(kept_fields.values())
    return kept_fields


def tuple_of_names(element_names: Iterable[str]) -> Expression:
    """Return a tuple of names without duplicates."""
    return tuple_of(text_literal(name) for name in dict.fromkeys(element_names))


def _result_type(returned: Returned, imports: Imports) -> Expression:
    return value_type(returned.type, imports, optional=returned.optional)


def value_type(declared_type: ValueType, imports: Imports, *, optional: bool = False) -> Expression:
    """Return the declaration of a value's type; an integer's bounds are written as integers if both are finite."""
    bounds = declared_type.range if declared_type.range is not None else ()
    has_integer_bounds = declared_type.kind is Kind.INT and all(map(math.isfinite, bounds))
    # literals, because a cache does not distinguish the numbers 0, 0.0 and -0.0
    literals = tuple([literal(int(bound) if has_integer_bounds else bound) for bound in bounds])
    imports.use(_TYPES[declared_type.kind])
    imports.use_math_for(literals)
    return _value_type(declared_type.kind, literals, declared_type.values, declared_type.unit, optional)


@lru_cache(maxsize=1024)
def _value_type(
    kind: Kind, bounds: tuple[str, ...], values: tuple[str, ...], unit: str | None, is_optional: bool
) -> Expression:
    keywords = {} if unit is None else {"unit": literal(unit)}
    keywords |= {"optional": "True"} if is_optional else {}
    return call(_TYPES[kind], *bounds, *map(text_literal, values), **keywords)
