"""Compare the topics of variables with the types of their messages."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from codra_dsl.language.diagnostics import Related, replacement_fix
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.message_types import MessageTypes, MissingField, UnreadableType
from codra_dsl.language.load.yaml.findings import Findings, list_names
from codra_dsl.language.model import Kind, Topic, Variable

_INTEGERS = frozenset({"char", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))})
_TEXTS = frozenset({"string", "wstring"})
_FIELD_TYPES = {
    Kind.BOOL: frozenset({"bool"}),
    Kind.INT: _INTEGERS,
    Kind.FLOAT: _INTEGERS | {"float32", "float64"},
    Kind.STR: _TEXTS,
    Kind.ENUM: _TEXTS,
}
"""For each kind of variable, the types of fields that can have its values."""

_KIND_OF_FIELD = {
    **dict.fromkeys(_INTEGERS, "int"),
    **dict.fromkeys(("float32", "float64"), "float"),
    **dict.fromkeys(_TEXTS, "str"),
    "bool": "bool",
}


def check_topics(variables: Iterable[Variable], root: Path, findings: Findings) -> tuple[str, ...]:
    """Report topics with unknown types or fields, and fields whose type does not fit the variable.

    Returns:
        The files, relative to `root`, on which the result depends.
    """
    with_topics = [(variable, variable.ros) for variable in variables if variable.ros is not None]
    if not with_topics:
        return ()
    try:
        types = MessageTypes(root)
    except ModuleNotFoundError:
        _report_unchecked(with_topics, findings)
        return ()
    variables_by_type: dict[str, list[tuple[Variable, Topic]]] = {}
    for variable, topic in with_topics:
        variables_by_type.setdefault(topic.type, []).append((variable, topic))
    for users in variables_by_type.values():
        fields = types.find(users[0][1].type)
        if isinstance(fields, UnreadableType):
            _report_type(fields, users, types, findings)
        else:
            for variable, topic in users:
                _check_field(variable, topic, types, findings)
    return tuple(types.consulted_files)


def _report_unchecked(users: Sequence[tuple[Variable, Topic]], findings: Findings) -> None:
    first, topic = users[0]
    others = [Related(f"also '{variable.name}'", other.places["ros"]) for variable, other in users[1:]]
    message = "types and fields of messages are not checked: the package 'rosbags' is not installed"
    help_text = "install codra with the extra 'ros'"
    path = f"context.{first.name}.ros"
    findings.add("unknown-message-type", message, topic.places["ros"], help=help_text, path=path, related=others)


def _report_type(
    problem: UnreadableType, users: Sequence[tuple[Variable, Topic]], types: MessageTypes, findings: Findings
) -> None:
    variable, topic = users[0]
    place = topic.places["type"]
    related = [Related(f"also for '{other.name}'", other_topic.places["type"]) for other, other_topic in users[1:]]
    fix = None
    if problem.file:
        message = f"the definition of {shown(problem.name)} in {shown(problem.file)} cannot be read"
        help_text = "correct the file, which contains the definition of a ROS message"
        if problem.reason:
            message = f"{message}: {problem.reason}"
            help_text = "use a regular file in the project, or correct 'messages' in [tool.codra.ros]"
    else:
        message = f"there is no definition of the message type {shown(problem.name)}"
        suggestion = findings.nearest(problem.name, types.names())
        fix = None if suggestion is None else replacement_fix(place, problem.name, suggestion, safe=False)
        if problem.name != topic.type:
            message, fix = f"{message}, which is in {shown(topic.type)}", None
        folder = types.folders[0] if types.folders else "."
        file = (Path(folder) / f"{problem.name}.msg").as_posix()
        help_text = (
            f"did you mean '{suggestion}'?"
            if fix is not None
            else f"copy the definition to {shown(file)}, or name its folder under 'messages' in [tool.codra.ros]"
        )
    path = f"context.{variable.name}.ros.type"
    findings.add("unknown-message-type", message, place, help=help_text, path=path, related=related, fix=fix)


def _check_field(variable: Variable, topic: Topic, types: MessageTypes, findings: Findings) -> None:
    field_type = types.type_of_field(topic.type, topic.field)
    if isinstance(field_type, UnreadableType):
        _report_type(field_type, [(variable, topic)], types, findings)
    elif isinstance(field_type, MissingField):
        _report_field(variable, topic, field_type, findings)
    elif field_type not in _FIELD_TYPES[variable.type.kind] and "type" in variable.type.places:
        message = (
            f"context-variable '{variable.name}' is of type {variable.type.kind}, "
            f"but the field {shown(topic.field)} of {shown(topic.type)} has the type {field_type}"
        )
        place, path = topic.places["field"], f"context.{variable.name}.ros.field"
        related = [Related("the type of the variable", variable.type.places["type"])]
        help_text = _mismatch_help(variable, field_type)
        findings.add("message-type-mismatch", message, place, help=help_text, path=path, related=related)


def _mismatch_help(variable: Variable, field_type: str) -> str:
    kind = _KIND_OF_FIELD.get(field_type)
    if kind is None:
        return f"choose another field: no variable can have values of type {field_type}"
    if variable.type.kind in (Kind.ENUM, Kind.BOOL):
        return f"let another variable of type {kind} have the field, and derive this variable from it"
    return f"write 'type: {kind}', or choose another field"


def _report_field(variable: Variable, topic: Topic, missing: MissingField, findings: Findings) -> None:
    place = topic.places["field"]
    fix = None
    if missing.problem:
        message = f"the field {shown(missing.part)} of {shown(missing.type)} {missing.problem}"
        help_text = f"add one of its fields: {list_names(missing.names)}" if missing.names else "correct the field"
    else:
        message = f"messages of type {shown(missing.type)} have no field {shown(missing.part)}"
        suggestion = findings.nearest(missing.part, missing.names)
        help_text = f"the fields are {list_names(missing.names)}" if missing.names else "the type has no fields"
        if suggestion is not None:
            help_text = f"did you mean '{suggestion}'?"
            if topic.field == missing.part:
                fix = replacement_fix(place, topic.field, suggestion, safe=False)
    path = f"context.{variable.name}.ros.field"
    findings.add("unknown-message-field", message, place, help=help_text, path=path, fix=fix)
