"""A walk through one function of a Python file, which finds the branches on the results of calls."""

from __future__ import annotations

import ast
import builtins
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Protocol

from codra_dsl.language.diagnostics import Place
from codra_dsl.language.frozen import dataclass
from codra_dsl.tooling.main_execution.model import Role, ValueType
from codra_dsl.tooling.main_execution.python_values import (
    UNKNOWN_TEXT,
    Call,
    Scope,
    Value,
    alternatives,
    formatted,
    merged_calls,
    sequence,
    table,
)

Function = ast.FunctionDef | ast.AsyncFunctionDef

_PERCEIVING = re.compile(
    r"_*(?:is|are|was|has|have|can|check|look|see|sees|detect|find|recogni[sz]e|locali[sz]e|locate|measure|estimate|"
    r"observe|perceive|sense|scan|query)(?:_|$)|.+_(?:is|are|was|has|have|can)_"
)
_CONTEXT_METHODS = frozenset({"decide", "get"})
"""The methods of a context manager that return a context-variable, given by its name."""

_LIBRARIES = sys.stdlib_module_names | {"rclpy", "rospy", "numpy"}
_METHODS_OF_VALUES = frozenset(name for type_ in (str, bytes, int, list, dict, set) for name in dir(type_)) - {"find"}
_BUILTINS = frozenset(dir(builtins))
_MAX_ARGUMENTS = 3
_MAX_SHOWN = 80


def perceives(function: Function) -> bool:
    """Return whether a function returns a value and has the name of a perception, such as `is_open` or `detect_cup`.

    A call of such a function is the decision, and branches inside it are the algorithm's own.
    """
    is_perceiving_name = _PERCEIVING.match(function.name) is not None
    return is_perceiving_name and any(isinstance(node, ast.Return) and node.value for node in ast.walk(function))


@dataclass(frozen=True, slots=True)
class Skill:
    """A skill of the main execution.

    Attributes:
        is_stated: whether `with codra.skill(NAME)` states it; otherwise a function is the skill.
        is_complete: whether the name is known completely.
    """

    name: str
    place: Place
    is_stated: bool
    is_complete: bool = True


@dataclass(frozen=True, slots=True)
class Branch:
    """A branch on the result of a call.

    Attributes:
        text: the part of the branch's test that depends on the call.
        place: the place of this part.
    """

    call: Call
    text: str
    place: Place
    skill: Skill
    role: Role
    type: ValueType

    @property
    def is_complete(self) -> bool:
        """Whether neither the variable nor the skill depends on a caller that is not in the file."""
        return self.call.is_complete and self.skill.is_complete


class Module(Protocol):
    """The module of a function."""

    def place(self, node: ast.expr | ast.stmt) -> Place:
        """Return the place of a node."""
        ...

    def count_step(self, node: ast.expr | ast.stmt) -> None:
        """Count one examined node."""

    def call(
        self, name: str, owner: str, arguments: tuple[Value, ...], keywords: Mapping[str, Value], skill: Skill
    ) -> Value | None:
        """Return the result of a function of the file that does not perceive, or None for another function."""
        ...

    def bind_attribute(self, owner: str, name: str, value: Value) -> None:
        """Bind an attribute of the objects of a class."""

    def attribute(self, owner: str, name: str) -> Value:
        """Return what is known about an attribute of the objects of a class."""
        ...


class Walk:
    """Walks through one function, or through the statements of a module.

    Attributes:
        branches: the branches on the results of calls.
        results: the values that the function returns.
    """

    def __init__(self, module: Module, scope: Scope, skill: Skill, owner: str) -> None:
        self.branches: list[Branch] = []
        self.results: list[Value] = []
        self._module = module
        self._scope = scope
        self._skill = skill
        self._owner = owner

    def statements(self, body: Iterable[ast.stmt]) -> None:
        """Walk through statements in their order; each branch is taken once."""
        for statement in body:
            self._module.count_step(statement)
            self._statement(statement)

    def _statement(self, statement: ast.stmt) -> None:
        match statement:
            case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
                return
            case ast.Import() | ast.ImportFrom():
                self._import(statement)
            case ast.Assign(targets=targets, value=value):
                for target in targets:
                    self._bind(target, self._value(value))
            case ast.AnnAssign(target=target, value=ast.expr() as value):
                self._bind(target, self._value(value))
            case ast.AugAssign(target=target):
                self._bind(target, self._compound(statement))
            case ast.For() | ast.AsyncFor() | ast.While():
                self._loop(statement)
            case ast.With(items=items) | ast.AsyncWith(items=items):
                self._with(items, statement.body)
            case ast.If(test=test):
                self._decide(test)
                self._one_of(statement.body, statement.orelse)
            case ast.Assert(test=test):
                self._decide(test)
            case ast.Match():
                self._match(statement)
            case ast.Try() | ast.TryStar():
                self._one_of(statement.body, ())  # an exception may end the body before it has bound anything
                self._one_of(statement.orelse, *(handler.body for handler in statement.handlers))
                self.statements(statement.finalbody)
            case ast.Return(value=ast.expr() as value):
                self.results.append(self._value(value))
            case _:
                self._compound(statement)

    def _one_of(self, *bodies: Sequence[ast.stmt]) -> None:
        """Walk through bodies of which one runs. Afterwards, a name has one of the values that they bind."""
        outer_scope, ends = self._scope, []
        for body in bodies:
            self._scope = Scope({}, outer_scope)
            self.statements(body)
            if not (body and isinstance(body[-1], ast.Return | ast.Raise)):
                ends.append(self._scope)
        self._scope = outer_scope
        outer_scope.join(ends)

    def _loop(self, loop: ast.For | ast.AsyncFor | ast.While) -> None:
        """Walk through a loop twice: what its body binds may decide at its beginning."""
        branch_count = len(self.branches)
        for _ in range(2):
            del self.branches[branch_count:]  # the second walk knows more
            if isinstance(loop, ast.While):
                self._decide(loop.test, Role.HOLD)
                self._one_of(loop.body, ())
            else:
                for item in _items(self._value(loop.iter)):
                    self._bind(loop.target, item)
                    self._one_of(loop.body, ())
        self.statements(loop.orelse)

    def _import(self, statement: ast.Import | ast.ImportFrom) -> None:
        for name in statement.names:
            if isinstance(statement, ast.ImportFrom):
                module, text, bound_name = statement.module or "", name.name, name.asname or name.name
            else:  # `import a.b` binds `a`
                bound_name = name.asname or name.name.partition(".")[0]
                module, text = name.name if name.asname else bound_name, ""
            is_relative = isinstance(statement, ast.ImportFrom) and statement.level > 0
            is_library = not is_relative and module.partition(".")[0] in _LIBRARIES
            self._scope.bind(bound_name, Value(text=text, module=module, is_library=is_library))

    def _match(self, statement: ast.Match) -> None:
        patterns = [node for case in statement.cases for node in ast.walk(case.pattern)]
        members = [node.value for node in patterns if isinstance(node, ast.MatchValue)]
        self._decide(statement.subject, type_=_type_beside(members))
        for case in statement.cases:
            if case.guard is not None:
                self._decide(case.guard)
        self._one_of((), *(case.body for case in statement.cases))

    def _with(self, items: Iterable[ast.withitem], body: Iterable[ast.stmt]) -> None:
        """Walk through a `with` statement; `with codra.skill(NAME)` states the skill of the decisions inside."""
        outer_skill = self._skill
        for item in items:
            expression, value = item.context_expr, self._value(item.context_expr)
            if isinstance(expression, ast.Call) and called_name(expression) == "skill" and expression.args:
                name = self._value(expression.args[0])
                if name.is_text or name.is_hole:
                    self._skill = Skill(name.text, self._module.place(expression), True, name.is_text)
            if item.optional_vars is not None:
                self._bind(item.optional_vars, value)
        self.statements(body)
        self._skill = outer_skill

    def _bind(self, target: ast.expr, value: Value) -> None:
        match target:
            case ast.Name() | ast.Attribute():
                name = _dotted_name(target)
                self._scope.bind(name, value)
                if name.startswith("self.") and value.calls:
                    self._module.bind_attribute(self._owner, name, value)
            case ast.Tuple(elts=targets) | ast.List(elts=targets):
                items = value.items if value.items is not None and len(value.items) == len(targets) else None
                for number, inner_target in enumerate(targets):
                    self._bind(inner_target, Value(calls=value.calls) if items is None else items[number])

    def _decide(self, test: ast.expr, role: Role = Role.PRECONDITION, type_: ValueType | None = None) -> None:
        """Add a branch for each call on whose result a test depends."""
        for part, value, part_type in _parts(test):
            for call in self._value(value).calls:
                text = " ".join(ast.unparse(part).split())[:_MAX_SHOWN]
                place = self._module.place(part)
                self.branches.append(Branch(call, text, place, self._skill, role, type_ or part_type))

    def _value(self, node: ast.expr) -> Value:
        """Return what is known about the value of an expression, and add the decisions inside the expression."""
        self._module.count_step(node)
        match node:
            case ast.Constant(value=value):
                return Value(text=str(value)[:_MAX_SHOWN], is_text=isinstance(value, str))
            case ast.JoinedStr(values=parts):
                return formatted(map(self._value, parts))
            case ast.FormattedValue(value=inner) | ast.Await(value=inner):
                return self._value(inner)
            case ast.Name() | ast.Attribute():
                return self._named_value(node)
            case ast.Tuple(elts=elements) | ast.List(elts=elements):
                return sequence([value for element in elements for value in self._argument(element)])
            case ast.Dict(keys=keys, values=values):
                pairs = zip(keys, values, strict=True)
                return table([(self._value(key).text, self._value(value)) for key, value in pairs if key is not None])
            case ast.Subscript(value=container, slice=key):
                holder, key_text = self._value(container), self._value(key).text
                return dict(holder.table).get(key_text) or Value(text=f"{holder.text}_{key_text}", calls=holder.calls)
            case ast.NamedExpr(target=target, value=inner):
                result = self._value(inner)
                self._bind(target, result)
                return result
            case ast.IfExp(test=test, body=body, orelse=orelse):
                self._decide(test)
                return alternatives([self._value(body), self._value(orelse)])
            case ast.Lambda():
                return Value()
            case ast.ListComp(elt=element) | ast.SetComp(elt=element) | ast.GeneratorExp(elt=element):
                return self._comprehension([element], node.generators)
            case ast.DictComp(key=key, value=inner):
                return self._comprehension([key, inner], node.generators)
            case ast.Call():
                return self._call(node)
            case _:
                return self._compound(node)

    def _compound(self, node: ast.AST) -> Value:
        """Return the value of an operation: it depends on the calls in all its parts."""
        parts = [part for part in ast.iter_child_nodes(node) if isinstance(part, ast.expr)]
        return Value(calls=merged_calls([self._value(part) for part in parts]))

    def _comprehension(self, elements: Sequence[ast.expr], generators: Sequence[ast.comprehension]) -> Value:
        if not generators:
            return Value(calls=merged_calls([self._value(element) for element in elements]))
        generator, *inner_generators = generators
        values = [self._value(generator.iter)]
        for item in _items(values[0]):
            self._bind(generator.target, item)
            for test in generator.ifs:
                self._decide(test)
            values.append(self._comprehension(elements, inner_generators))
        return Value(calls=merged_calls(values))

    def _named_value(self, node: ast.Name | ast.Attribute) -> Value:
        name = _dotted_name(node)
        value = self._scope.get(name)
        if isinstance(node, ast.Name):
            return value or Value(text=name)
        bound = self._module.attribute(self._owner, name) if name.startswith("self.") else Value()
        if value is None:  # `seen.angle` derives from `seen`
            value = Value(text=name or UNKNOWN_TEXT, calls=self._value(node.value).calls)
        return replace(value, calls=merged_calls([value, bound])) if bound.calls else value

    def _argument(self, argument: ast.expr) -> tuple[Value, ...]:
        if isinstance(argument, ast.Starred):
            value = self._value(argument.value)
            return _items(value)
        return (self._value(argument),)

    def _call(self, node: ast.Call) -> Value:
        name = _dotted_name(node.func)
        arguments = tuple(value for argument in node.args for value in self._argument(argument))
        keywords = {keyword.arg or "**": self._value(keyword.value) for keyword in node.keywords}
        if not name or self._is_transparent(name):
            receiver = (self._value(node.func),) if isinstance(node.func, ast.Attribute) else ()
            return Value(calls=merged_calls((*receiver, *arguments, *keywords.values())))
        result = self._module.call(name, self._owner, arguments, keywords, self._skill)
        if result is not None:
            return result
        is_context = name.rpartition(".")[2] in _CONTEXT_METHODS and "codra" in name.lower() and bool(arguments)
        call = Call(
            function=self._qualified(name),
            arguments=tuple(
                Value(text=value.text, is_text=value.is_text, is_hole=value.is_hole)
                for value in (*arguments, *(value for value in keywords.values() if value.is_text or value.is_hole))
            )[:_MAX_ARGUMENTS],
            place=self._module.place(node),
            is_context=is_context,
        )
        return Value(text=name, calls=(call,))

    def _is_transparent(self, name: str) -> bool:
        """Return whether a call perceives nothing: its result derives from its receiver and its arguments.

        Such calls are those of built-in functions, of methods of texts and containers, of classes, and of libraries.
        """
        root, _, _ = name.partition(".")
        method = name.rpartition(".")[2]
        binding = self._scope.get(root)
        if binding is not None and binding.is_library:
            return True
        is_class = method[:1].isupper() and not method.isupper()
        is_method_of_value = "." in name and method in _METHODS_OF_VALUES and "codra" not in name.lower()
        return is_class or is_method_of_value or (name in _BUILTINS and binding is None)

    def _qualified(self, name: str) -> str:
        """Return the name of a function with its module, `module:function`, if the file imports it."""
        root, _, rest = name.partition(".")
        binding = self._scope.get(root)
        if binding is None or not binding.module:
            return name
        return f"{binding.module}:{'.'.join(filter(None, (binding.text, rest)))}"


def called_name(node: ast.Call) -> str:
    """Return the last part of the name of a called function, or an empty text."""
    function = node.func
    return function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")


def _items(value: Value) -> tuple[Value, ...]:
    """Return the items of a sequence, or one item for all if they are not known."""
    return value.items if value.items is not None else (Value(is_hole=value.is_hole, calls=value.calls),)


def _dotted_name(node: ast.expr) -> str:
    """Return `a.b.c`, or an empty text for other expressions."""
    parts: list[str] = []
    while isinstance(node, ast.Attribute):
        parts.append(node.attr)
        node = node.value
    return ".".join([node.id, *reversed(parts)]) if isinstance(node, ast.Name) else ""


def _parts(test: ast.expr) -> Iterator[tuple[ast.expr, ast.expr, ValueType]]:
    """Yield the parts of a test that decide, each with a value on which it depends and the type of this value."""
    match test:
        case ast.BoolOp(values=operands):
            for operand in operands:
                yield from _parts(operand)
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            yield from _parts(operand)
        case ast.Compare(left=left, comparators=comparators):
            sides = (left, *comparators)
            type_ = _type_beside([member for side in sides for member in getattr(side, "elts", [side])])
            yield from ((test, side, type_) for side in sides if not isinstance(side, ast.Constant))
        case _:
            yield test, test, ValueType.BOOL


def _type_beside(values: Iterable[ast.expr]) -> ValueType:
    """Return the type of a value that is compared with these values."""
    values = list(values)
    names = [_dotted_name(value).rpartition(".")[2] for value in values if isinstance(value, ast.Attribute)]
    constants = [value.value for value in values if isinstance(value, ast.Constant)]
    types = {type(constant) for constant in (*constants, *filter(str.isupper, names))}  # `Result.FAILED` is a text
    return ValueType.STR if str in types else ValueType.FLOAT if types & {int, float} else ValueType.BOOL
