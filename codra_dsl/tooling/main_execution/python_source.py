"""The decisions of a main execution in plain Python: branches on the results of calls.

The file is read as a syntax tree; nothing is imported or run. Functions of the file are followed with the texts that
their callers pass, so that `self._decide(f"{machine}_open")` is one decision for each machine.
"""

from __future__ import annotations

import ast
import warnings
from collections.abc import Iterator, Mapping
from importlib.util import decode_source
from pathlib import Path

from codra_dsl.language.diagnostics import Place, Span
from codra_dsl.language.project import relative_path
from codra_dsl.regular_files import read_regular_file
from codra_dsl.tooling.main_execution.model import (
    Decision,
    DecisionCollector,
    MainExecution,
    Names,
    Role,
    SourceError,
)
from codra_dsl.tooling.main_execution.python_values import Scope, Value, alternatives, merged_calls, sequence
from codra_dsl.tooling.main_execution.python_walk import Branch, Function, Skill, Walk, called_name, perceives

MAX_BYTES = 1024 * 1024
MAX_STEPS = 200_000
"""The maximum number of statements and expressions that are examined; a followed function counts at each call."""

_MAX_CALL_DEPTH = 20
_MAX_BASES = 20


def read_python(path: Path, root: Path, within: Path) -> MainExecution:
    """Return the decisions of a Python file.

    Args:
        path: the file.
        root: the folder to which paths in places are relative.
        within: the folder of the project. Links that lead out of it are not followed.

    Raises:
        SourceError: if the file cannot be read, is not valid Python, or is too large.
    """
    file = relative_path(path, root)
    beginning = Place(Span(file, 1, 1, 1, 1))
    try:
        data = read_regular_file(path, MAX_BYTES, within=within)
    except OSError as error:
        raise SourceError(f"cannot read '{file}': {error.strerror}", beginning, help="check the path") from error
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            text = decode_source(data)
            module = ast.parse(text)
        return _Reader(module, _Places(file, text), path.stem).main_execution()
    except (RecursionError, MemoryError) as error:
        raise SourceError("the code is nested too deeply", beginning, help="split long expressions") from error
    except SyntaxError as error:
        line, column = max(error.lineno or 1, 1), max(error.offset or 1, 1)
        place = Place(Span(file, line, column, line, column + 1))
        raise SourceError(f"this is not valid Python: {error.msg}", place, help="correct it") from error
    except (ValueError, LookupError) as error:  # other encodings, null bytes, and numbers with too many digits
        raise SourceError(f"this is not valid Python: {error}", beginning, help="correct it") from error


class _Places:
    """Converts the places of syntax trees, whose columns count bytes."""

    def __init__(self, file: str, text: str) -> None:
        self._file = file
        self._lines = text.split("\n")

    @property
    def beginning(self) -> Place:
        return Place(Span(self._file, 1, 1, 1, 1))

    def of(self, node: ast.expr | ast.stmt) -> Place:
        end_line, end_offset = node.end_lineno or node.lineno, node.end_col_offset or node.col_offset
        start, end = self._column(node.lineno, node.col_offset), self._column(end_line, end_offset)
        return Place(Span(self._file, node.lineno, start, end_line, end))

    def _column(self, line: int, offset: int) -> int:
        text = self._lines[line - 1] if line <= len(self._lines) else ""
        return len(text.encode()[:offset].decode("utf-8", "replace")) + 1


class _Reader:
    """Follows the functions of one module."""

    def __init__(self, module: ast.Module, places: _Places, stem: str) -> None:
        self._module = module
        self._places = places
        self._stem = stem
        self._functions = list(_functions(module))
        self._function_by_name = {(owner, function.name): function for owner, function in self._functions}
        self._bases = {
            node.name: [base.id for base in node.bases[:_MAX_BASES] if isinstance(base, ast.Name)]
            for node in ast.walk(module)
            if isinstance(node, ast.ClassDef)
        }
        self._attributes: dict[tuple[str, str], Value] = {}
        self._branches: dict[Branch, None] = {}
        self._returned: dict[Branch, None] = {}
        self._perceiving: dict[Function, bool] = {}
        self._results: dict[object, Value] = {}
        self._followed: set[Function] = set()
        self._steps_left = MAX_STEPS
        self._active: set[Function] = set()
        self._globals = Scope({})

    def main_execution(self) -> MainExecution:
        """Return the decisions of the module, each with its variable."""
        self._follow_all()
        self._follow_all()  # functions may decide on attributes and global names that are bound later
        decided_calls = {branch.call for branch in self._branches}
        self._branches |= {branch: None for branch in self._returned if branch.call not in decided_calls}
        return self._named()

    def _follow_all(self) -> None:
        for collection in (self._branches, self._returned, self._results, self._followed):
            collection.clear()
        self._steps_left = MAX_STEPS
        whole_module = Skill(self._stem, self._places.beginning, is_stated=False)
        walk = Walk(self, self._globals, whole_module, "")
        walk.statements(self._module.body)
        self._branches |= dict.fromkeys(walk.branches)
        called_names = {called_name(node) for node in ast.walk(self._module) if isinstance(node, ast.Call)}
        functions = sorted(self._functions, key=lambda item: item[1].name in called_names)
        for owner, function in functions:  # functions that nothing calls come first: they call the others
            if function not in self._followed and not self._perceives(function):
                self.follow(function, owner, _bound(function, (), {}, is_method=bool(owner)), None)

    def _named(self) -> MainExecution:
        complete_places = {branch.place for branch in self._branches if branch.is_complete}
        variables, skills = Names("decision"), Names("skill")
        collector = DecisionCollector()
        for branch in self._branches:
            call = branch.call
            if not branch.is_complete and branch.place in complete_places:
                continue  # the function is also followed from callers that state the arguments
            decision = Decision(
                name=variables.name(call.key, call.words),
                text=branch.text,
                skill=skills.name((branch.skill.name,), (branch.skill.name,)),
                role=branch.role,
                place=branch.place,
                type=branch.type,
                call="" if call.is_context else call.function,
                other_names=call.texts,
            )
            collector.add(decision, branch.skill.place)
        return collector.main_execution()

    def _perceives(self, function: Function) -> bool:
        if function not in self._perceiving:
            self._perceiving[function] = perceives(function)
        return self._perceiving[function]

    # For walks

    def place(self, node: ast.expr | ast.stmt) -> Place:
        """Return the place of a node."""
        return self._places.of(node)

    def count_step(self, node: ast.expr | ast.stmt) -> None:
        """Count one examined node.

        Raises:
            SourceError: if there are too many.
        """
        self._steps_left -= 1
        if self._steps_left < 0:
            message = f"following the calls takes more than {MAX_STEPS:,} steps"
            raise SourceError(message, self.place(node), help="split the file, and import its parts")

    def call(
        self, name: str, owner: str, arguments: tuple[Value, ...], keywords: Mapping[str, Value], skill: Skill
    ) -> Value | None:
        """Return the result of a function of the file that does not perceive, or None for another function.

        Args:
            name: the function; for a method of the class `owner`, `self.name`.
            owner: the class of the caller; empty if the caller is not a method.
            arguments: the positional arguments.
            keywords: the arguments by name.
            skill: the skill of the caller.
        """
        is_method, simple_name = name.startswith(("self.", "cls.")), name.rpartition(".")[2]
        owners = self._lineage(owner) if is_method else [""]
        keys = [(candidate, simple_name) for candidate in owners if name.count(".") == is_method]
        function = next((self._function_by_name[key] for key in keys if key in self._function_by_name), None)
        if function is None or self._perceives(function):
            return None
        continues_skill = skill.is_stated or simple_name.startswith("_")
        bound = _bound(function, arguments, keywords, is_method=is_method)
        return self.follow(function, owner if is_method else "", bound, skill if continues_skill else None)

    def bind_attribute(self, owner: str, name: str, value: Value) -> None:
        """Bind an attribute of the objects of a class: a method may decide on what another method has bound."""
        known = self._attributes.get((owner, name), Value())
        self._attributes[owner, name] = Value(calls=merged_calls([known, value]))

    def attribute(self, owner: str, name: str) -> Value:
        """Return what is known about an attribute of the objects of a class and of its base classes."""
        return Value(calls=merged_calls(self._attributes.get((known, name), Value()) for known in self._lineage(owner)))

    def _lineage(self, owner: str) -> list[str]:
        """Return a class and its base classes in the file, as far as there are not too many."""
        lineage = [owner]
        for known in lineage:
            if len(lineage) < _MAX_BASES:
                lineage += (base for base in self._bases.get(known, ()) if base not in lineage)
        return lineage

    def follow(self, function: Function, owner: str, arguments: Mapping[str, Value], skill: Skill | None) -> Value:
        """Examine a function and return its result, which is unknown within a recursion.

        Args:
            function: the function.
            owner: its class, or empty.
            arguments: the values of its parameters.
            skill: the skill of the caller; None if the function is a skill of its own.
        """
        skill = skill or Skill(function.name, self.place(function), is_stated=False)
        key = (function, owner, tuple(sorted(arguments.items())), skill)
        if key in self._results or function in self._active or len(self._active) >= _MAX_CALL_DEPTH:
            return self._results.get(key, Value())
        is_called = bool(self._active)
        self._followed.add(function)
        self._active.add(function)
        walk = Walk(self, Scope(dict(arguments), self._globals), skill, owner)
        walk.statements(function.body)
        self._active.remove(function)
        self._results[key] = result = alternatives(walk.results)
        # A function that also returns the result of a call leaves the decision on it to its callers, except in loops.
        for branch in walk.branches:
            is_left = is_called and branch.call in result.calls and branch.role is Role.PRECONDITION
            (self._returned if is_left else self._branches)[branch] = None
        return self._results[key]


def _functions(module: ast.Module) -> Iterator[tuple[str, Function]]:
    """Yield the functions of a module, each with its class; functions in functions have no class."""
    pending: list[tuple[str, ast.AST]] = [("", module)]
    while pending:
        owner, node = pending.pop(0)
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
                yield owner, child
            if isinstance(child, ast.stmt | ast.ExceptHandler | ast.match_case):
                inner_owner = child.name if isinstance(child, ast.ClassDef) else owner
                pending.append(
                    ("" if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef) else inner_owner, child)
                )


def _bound(
    function: Function, arguments: tuple[Value, ...], keywords: Mapping[str, Value], *, is_method: bool
) -> dict[str, Value]:
    """Return the values of a function's parameters. A parameter that gets no value depends on other callers."""
    signature = function.args
    is_static = any(isinstance(node, ast.Name) and node.id == "staticmethod" for node in function.decorator_list)
    names = [parameter.arg for parameter in (*signature.posonlyargs, *signature.args)][is_method and not is_static :]
    defaults = dict(zip(reversed(names), reversed(signature.defaults), strict=False))
    defaults |= {
        parameter.arg: default
        for parameter, default in zip(signature.kwonlyargs, signature.kw_defaults, strict=True)
        if default is not None
    }
    bound = {name: Value(text=name, is_hole=True) for name in (*names, *(item.arg for item in signature.kwonlyargs))}
    for name, default in defaults.items():
        text = default.value if isinstance(default, ast.Constant) else None
        bound[name] = Value(text=text, is_text=True) if isinstance(text, str) else Value(text=name)
    bound |= dict(zip(names, arguments, strict=False)) | {name: keywords[name] for name in keywords if name in bound}
    if signature.vararg is not None:
        rest = arguments[len(names) :]
        unknown = Value(text=signature.vararg.arg, is_hole=True)
        bound[signature.vararg.arg] = sequence(rest) if rest else unknown
    return bound
