"""Typed access to the variables of a spec: methods whose signatures tie the names of variables to their values.

There is one signature for each type of value, not for each variable, so that a spec may have any number of variables.
One further signature accepts any name, but no value: with a name that may be that of variables of several types, a
program can read and declare, but not write. The signatures are for editors and type checkers: at run time the calls
reach the context manager directly.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from codra_dsl.generation.emit.layout import WIDTH, lay_out, make_brackets
from codra_dsl.generation.emit.literals import text_literal

_OUTER, _INNER = 8 * " ", 12 * " "
_NAMES = "VariableName"


@dataclass(frozen=True, slots=True, kw_only=True)
class Values:
    """The variables whose values have one type in Python.

    Attributes:
        variables: the names of the variables.
        alias: the name that signatures use for the type of these names.
        type: the type of the values.
        answer: the type variable for the result of sequential perception of one of the variables.
        members: the members of an enum, for which `type` is an alias too; empty for other types.
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
        typed_argument: the argument after `name`, whose type depends on the variable's type, for variables of one type.
        last_argument: this argument for variables of any type: it accepts only what fits all types.
        implementation_argument: this argument in the definition that follows several signatures.
        other_arguments: further arguments, with their defaults.
        returns: the return type for variables of one type.
        last_returns: the return type for variables of several types.
    """

    name: str
    docstring: str
    typed_argument: str
    last_argument: str
    implementation_argument: str
    other_arguments: Mapping[str, str]
    returns: str
    last_returns: str


_SHAPES = (
    _Shape(
        name="get",
        docstring="Return the current reading of a variable.",
        typed_argument="",
        last_argument="",
        implementation_argument="",
        other_arguments={},
        returns="Reading[{type}]",
        last_returns="Reading[Any]",
    ),
    _Shape(
        name="set",
        docstring="Write a variable as the main execution.",
        typed_argument="value: {type}",
        last_argument="value: Never",
        implementation_argument="value: Any",
        other_arguments={"evidence_s: float | None": "None"},
        returns="None",
        last_returns="None",
    ),
    _Shape(
        name="declare",
        docstring="Add a variable to the needs of the main execution, with a value if it knows one.",
        typed_argument="value: {type} | None = None",
        last_argument="value: None = None",
        implementation_argument="value: Any = None",
        other_arguments={},
        returns="None",
        last_returns="None",
    ),
    _Shape(
        name="decide",
        docstring="Answer a decision from context, or fall back to sequential perception.",
        typed_argument="otherwise: Callable[[], {answer}]",
        last_argument="otherwise: Callable[[], Never]",
        implementation_argument="otherwise: Callable[[], Any]",
        other_arguments={
            "max_age_s: float": "math.inf",
            "since_s: float": "-math.inf",
            "wait_up_to_s: float": "0.0",
            "shadow: bool": "False",
        },
        returns="{type} | {answer}",
        last_returns="Any",
    ),
)


def methods(kinds: Sequence[Values]) -> Iterator[Method]:
    """Yield the methods for variables of some types; a spec without variables has no methods."""
    for shape in _SHAPES if kinds else ():
        yield _overloaded_method(shape, kinds) if len(kinds) > 1 else _single_signature_method(shape, kinds[0])


def _overloaded_method(shape: _Shape, kinds: Sequence[Values]) -> Method:
    """Return a method with one signature for each type, and a last signature that accepts any name, but no value."""
    other_arguments = [f"{argument} = ..." for argument in shape.other_arguments]
    overloads = [
        _signature(
            shape,
            kind.alias,
            _with_types(shape.typed_argument, kind),
            other_arguments,
            _with_types(shape.returns, kind),
        )
        for kind in kinds
    ]
    overloads.append(_signature(shape, _NAMES, shape.last_argument, other_arguments, shape.last_returns))
    definition = _signature(shape, _NAMES, shape.implementation_argument, _with_defaults(shape), shape.last_returns)
    return Method(tuple(overloads), definition, shape.docstring)


def _single_signature_method(shape: _Shape, kind: Values) -> Method:
    """Return a method for values of one type."""
    definition = _signature(
        shape, _NAMES, _with_types(shape.typed_argument, kind), _with_defaults(shape), _with_types(shape.returns, kind)
    )
    return Method((), definition, shape.docstring)


def _with_defaults(shape: _Shape) -> list[str]:
    return [f"{argument} = {default}" for argument, default in shape.other_arguments.items()]


def _with_types(text: str, kind: Values) -> str:
    return text.format(type=kind.type, answer=kind.answer)


def _signature(shape: _Shape, names: str, typed_argument: str, other_arguments: Sequence[str], returns: str) -> str:
    """Return a signature as `ruff format` writes it: on one line, or all arguments on one, or one argument a line."""
    before, after = f"def {shape.name}(", f") -> {returns}:"
    arguments = (
        "self",
        f"name: {names}",
        *([typed_argument] if typed_argument else []),
        *(["*", *other_arguments] if other_arguments else []),
    )
    flat = ", ".join(arguments)
    if len(_OUTER) + len(before) + len(flat) + len(after) + len(" ...") <= WIDTH:
        return f"{before}{flat}{after}"
    if len(_INNER) + len(flat) <= WIDTH:
        return f"{before}\n{_INNER}{flat}\n{_OUTER}{after}"
    if len(_OUTER) + len(after) + len(" ...") > WIDTH and " | " in returns:
        types = f"\n{_INNER}| ".join(returns.split(" | "))
        after = f") -> (\n{_INNER}{types}\n{_OUTER}):"
    lines = f",\n{_INNER}".join(arguments)
    return f"{before}\n{_INNER}{lines},\n{_OUTER}{after}"


def alias(name: str, members: Iterable[str]) -> str:
    """Return the statement that makes `name` an alias for the literal type of some strings."""
    items = tuple(map(text_literal, dict.fromkeys(members)))
    literals = lay_out(make_brackets("Literal[", items, "]"), before=len(name) + 3)
    return f"{name} = {literals if items else 'Never'}"
