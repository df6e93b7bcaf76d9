"""Typed access to the variables of a spec: methods whose signatures tie the names of variables to their values.

There is one signature for each type of value, not for each variable, so that a spec may have any number of variables,
and one for any name that accepts no value: variables of several types can be read and declared, but not written. The
signatures are for editors and type checkers: at run time the calls reach the context manager directly.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from codra_dsl.generation.emit.layout import WIDTH, bracketed, laid_out
from codra_dsl.generation.emit.literals import text_literal

_OUTER, _INNER = 8 * " ", 12 * " "
_NAMES = "VariableName"


@dataclass(frozen=True, slots=True, kw_only=True)
class Values:
    """The variables whose values have one type in Python.

    Attributes:
        variables: their names.
        alias: the name of the type of those names in signatures.
        type: of their values.
        answer: the type variable for the result of sequential perception of one of them.
        members: the members of an enum, whose type is an alias as well.
    """

    variables: tuple[str, ...]
    alias: str
    type: str
    answer: str
    members: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Method:
    """A method of the generated context manager, as its template takes it."""

    overloads: tuple[str, ...]
    definition: str
    docstring: str


@dataclass(frozen=True, slots=True)
class _Shape:
    """A method before its types are put in.

    Attributes:
        typed: the argument after `name` whose type depends on the variable's, for one type.
        last: the same for variables of any type: only what fits all of them.
        implementation: the same in the definition that follows several signatures.
        rest: further arguments, with their defaults.
        returns: its return type for one type of value.
        returned: its return type for several types.
    """

    name: str
    docstring: str
    typed: str
    last: str
    implementation: str
    rest: Mapping[str, str]
    returns: str
    returned: str


_SHAPES = (
    _Shape(
        name="get",
        docstring="Return the current reading of a variable.",
        typed="",
        last="",
        implementation="",
        rest={},
        returns="Reading[{type}]",
        returned="Reading[Any]",
    ),
    _Shape(
        name="set",
        docstring="Write a variable as the main execution.",
        typed="value: {type}",
        last="value: Never",
        implementation="value: Any",
        rest={"evidence_s: float | None": "None"},
        returns="None",
        returned="None",
    ),
    _Shape(
        name="declare",
        docstring="Add a variable to the needs of the main execution, with a value if it knows one.",
        typed="value: {type} | None = None",
        last="value: None = None",
        implementation="value: Any = None",
        rest={},
        returns="None",
        returned="None",
    ),
    _Shape(
        name="decide",
        docstring="Answer a decision from context, or fall back to sequential perception.",
        typed="otherwise: Callable[[], {answer}]",
        last="otherwise: Callable[[], Never]",
        implementation="otherwise: Callable[[], Any]",
        rest={
            "max_age_s: float": "math.inf",
            "since_s: float": "-math.inf",
            "wait_up_to_s: float": "0.0",
            "shadow: bool": "False",
        },
        returns="{type} | {answer}",
        returned="Any",
    ),
)


def methods(kinds: Sequence[Values]) -> Iterator[Method]:
    """Yield the methods for variables of some types; a spec without variables has no methods."""
    for shape in _SHAPES if kinds else ():
        yield _overloaded(shape, kinds) if len(kinds) > 1 else _plain(shape, kinds[0])


def _overloaded(shape: _Shape, kinds: Sequence[Values]) -> Method:
    """Return a method with one signature for each type, and a last one for any name that accepts no value."""
    rest = [f"{argument} = ..." for argument in shape.rest]
    overloads = [
        _signature(shape, kind.alias, _of(shape.typed, kind), rest, _of(shape.returns, kind)) for kind in kinds
    ]
    overloads.append(_signature(shape, _NAMES, shape.last, rest, shape.returned))
    definition = _signature(shape, _NAMES, shape.implementation, _with_defaults(shape), shape.returned)
    return Method(tuple(overloads), definition, shape.docstring)


def _plain(shape: _Shape, kind: Values) -> Method:
    """Return a method for values of one type."""
    definition = _signature(shape, _NAMES, _of(shape.typed, kind), _with_defaults(shape), _of(shape.returns, kind))
    return Method((), definition, shape.docstring)


def _with_defaults(shape: _Shape) -> list[str]:
    return [f"{argument} = {default}" for argument, default in shape.rest.items()]


def _of(text: str, kind: Values) -> str:
    return text.format(type=kind.type, answer=kind.answer)


def _signature(shape: _Shape, names: str, typed: str, rest: Sequence[str], returns: str) -> str:
    """Return a signature as `ruff format` writes it: on one line, else all arguments on one, else one a line."""
    before, after = f"def {shape.name}(", f") -> {returns}:"
    given = ("self", f"name: {names}", *([typed] if typed else []), *(["*", *rest] if rest else []))
    flat = ", ".join(given)
    if len(_OUTER) + len(before) + len(flat) + len(after) + len(" ...") <= WIDTH:
        return f"{before}{flat}{after}"
    if len(_INNER) + len(flat) <= WIDTH:
        return f"{before}\n{_INNER}{flat}\n{_OUTER}{after}"
    if len(_OUTER) + len(after) + len(" ...") > WIDTH and " | " in returns:
        types = f"\n{_INNER}| ".join(returns.split(" | "))
        after = f") -> (\n{_INNER}{types}\n{_OUTER}):"
    lines = f",\n{_INNER}".join(given)
    return f"{before}\n{_INNER}{lines},\n{_OUTER}{after}"


def alias(name: str, members: Iterable[str]) -> str:
    """Return the statement that makes `name` an alias for the type of some strings."""
    items = tuple(map(text_literal, dict.fromkeys(members)))
    literals = laid_out(bracketed("Literal[", items, "]"), before=len(name) + 3)
    return f"{name} = {literals if items else 'Never'}"
