"""Typed access to the variables of a spec: signatures that connect the names of variables with the types of values.

There is one signature for each type of value, not for each variable, so that a spec may have any number of variables.
One further signature accepts any name, but no value. So if a name may belong to variables of several types, a program
can read and declare the variable, but cannot write it. The signatures are for editors and type checkers: at run time,
the calls go directly to the context manager.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from codra_dsl.generation.emit.layout import WIDTH, lay_out, make_brackets
from codra_dsl.generation.emit.literals import text_literal
from codra_dsl.language.frozen import dataclass

_METHOD_INDENT, _ARGUMENT_INDENT = 8 * " ", 12 * " "
_ANY_NAME_ALIAS = "VariableName"


@dataclass(frozen=True, slots=True, kw_only=True)
class VariableGroup:
    """The variables whose values have one type in Python.

    Attributes:
        variables: the names of the variables.
        alias: the name of the literal type of these names, for signatures.
        type: the type of the values.
        answer: the type variable for the result of sequential perception of one of the variables.
        members: the members of an enum, in which case `type` is an alias for them; empty for other types.
    """

    variables: tuple[str, ...]
    alias: str
    type: str
    answer: str
    members: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Method:
    """A method of the generated context manager, in the form that its template needs."""

    overloads: tuple[str, ...]
    definition: str
    docstring: str


@dataclass(frozen=True, slots=True)
class _Shape:
    """A method whose types have not been filled in.

    Attributes:
        typed_argument: for variables of one type, the argument after `name`; its type depends on the type of the
            variables.
        fallback_argument: the same argument for variables of any type: it accepts only values that fit all types.
        implementation_argument: the same argument in the definition that follows several signatures.
        other_arguments: further arguments, with their defaults.
        return_type: the return type for variables of one type.
        fallback_return_type: the return type for variables of several types.
    """

    name: str
    docstring: str
    typed_argument: str
    fallback_argument: str
    implementation_argument: str
    other_arguments: Mapping[str, str]
    return_type: str
    fallback_return_type: str


_SHAPES = (
    _Shape(
        name="get",
        docstring="Return the current reading of a variable.",
        typed_argument="",
        fallback_argument="",
        implementation_argument="",
        other_arguments={},
        return_type="Reading[{type}]",
        fallback_return_type="Reading[Any]",
    ),
    _Shape(
        name="set",
        docstring="Write a variable as the main execution.",
        typed_argument="value: {type}",
        fallback_argument="value: Never",
        implementation_argument="value: Any",
        other_arguments={"evidence_s: float | None": "None"},
        return_type="None",
        fallback_return_type="None",
    ),
    _Shape(
        name="declare",
        docstring="Add a variable to the needs of the main execution, with a value if it knows one.",
        typed_argument="value: {type} | None = None",
        fallback_argument="value: None = None",
        implementation_argument="value: Any = None",
        other_arguments={},
        return_type="None",
        fallback_return_type="None",
    ),
    _Shape(
        name="decide",
        docstring="Answer a decision from context, or fall back to sequential perception.",
        typed_argument="otherwise: Callable[[], {answer}]",
        fallback_argument="otherwise: Callable[[], Never]",
        implementation_argument="otherwise: Callable[[], Any]",
        other_arguments={
            "max_age_s: float": "math.inf",
            "since_s: float": "-math.inf",
            "wait_up_to_s: float": "0.0",
            "shadow: bool": "False",
        },
        return_type="{type} | {answer}",
        fallback_return_type="Any",
    ),
)


def methods(groups: Sequence[VariableGroup]) -> Iterator[Method]:
    """Yield the methods for groups of variables; a spec without variables has no methods."""
    for shape in _SHAPES if groups else ():
        yield _overloaded_method(shape, groups) if len(groups) > 1 else _single_signature_method(shape, groups[0])


def _overloaded_method(shape: _Shape, groups: Sequence[VariableGroup]) -> Method:
    """Return a method with one signature for each type, and a last signature that accepts any name, but no value."""
    other_arguments = [f"{argument} = ..." for argument in shape.other_arguments]
    overloads = [
        _signature(
            shape,
            group.alias,
            _fill_in_types(shape.typed_argument, group),
            other_arguments,
            _fill_in_types(shape.return_type, group),
        )
        for group in groups
    ]
    overloads.append(
        _signature(shape, _ANY_NAME_ALIAS, shape.fallback_argument, other_arguments, shape.fallback_return_type)
    )
    definition = _signature(
        shape,
        _ANY_NAME_ALIAS,
        shape.implementation_argument,
        _arguments_with_defaults(shape),
        shape.fallback_return_type,
    )
    return Method(tuple(overloads), definition, shape.docstring)


def _single_signature_method(shape: _Shape, group: VariableGroup) -> Method:
    """Return a method for values of one type."""
    definition = _signature(
        shape,
        _ANY_NAME_ALIAS,
        _fill_in_types(shape.typed_argument, group),
        _arguments_with_defaults(shape),
        _fill_in_types(shape.return_type, group),
    )
    return Method((), definition, shape.docstring)


def _arguments_with_defaults(shape: _Shape) -> list[str]:
    return [f"{argument} = {default}" for argument, default in shape.other_arguments.items()]


def _fill_in_types(text: str, group: VariableGroup) -> str:
    return text.format(type=group.type, answer=group.answer)


def _signature(shape: _Shape, names: str, typed_argument: str, other_arguments: Sequence[str], return_type: str) -> str:
    """Return a signature as `ruff format` writes it: on one line, with all arguments on one line, or one per line."""
    before, after = f"def {shape.name}(", f") -> {return_type}:"
    arguments = (
        "self",
        f"name: {names}",
        *([typed_argument] if typed_argument else []),
        *(["*", *other_arguments] if other_arguments else []),
    )
    flat = ", ".join(arguments)
    if len(_METHOD_INDENT) + len(before) + len(flat) + len(after) + len(" ...") <= WIDTH:
        return f"{before}{flat}{after}"
    if len(_ARGUMENT_INDENT) + len(flat) <= WIDTH:
        return f"{before}\n{_ARGUMENT_INDENT}{flat}\n{_METHOD_INDENT}{after}"
    if len(_METHOD_INDENT) + len(after) + len(" ...") > WIDTH and " | " in return_type:
        types = f"\n{_ARGUMENT_INDENT}| ".join(return_type.split(" | "))
        after = f") -> (\n{_ARGUMENT_INDENT}{types}\n{_METHOD_INDENT}):"
    lines = f",\n{_ARGUMENT_INDENT}".join(arguments)
    return f"{before}\n{_ARGUMENT_INDENT}{lines},\n{_METHOD_INDENT}{after}"


def alias_statement(name: str, members: Iterable[str]) -> str:
    """Return the statement that makes `name` an alias for the literal type of some strings."""
    items = tuple(map(text_literal, dict.fromkeys(members)))
    literals_text = lay_out(make_brackets("Literal[", items, "]"), before=len(name) + 3)
    return f"{name} = {literals_text if items else 'Never'}"
