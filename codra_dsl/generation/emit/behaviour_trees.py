"""Write behaviour trees as a Python module with one function per tree.

The module only connects nodes; the runtime implements them. From codra it imports only
`codra_dsl.runtime.generated_api`. The same trees give the same bytes.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping

from codra_dsl.generation.emit.imports import import_statement
from codra_dsl.generation.emit.layout import (
    SHORT_TEXT_LENGTH,
    WIDTH,
    Chain,
    Expression,
    Grouped,
    call,
    dictionary,
    lay_out,
    spread_call,
    spread_dictionary,
    spread_tuple,
    tuple_of,
)
from codra_dsl.generation.emit.literals import literal, prose
from codra_dsl.generation.emit.scripts import operand_texts, truth_text, value_text
from codra_dsl.language.behavior_trees import BehaviorTree, CheckedForest, Direction, NodeKind, NodeModel, TreeNode
from codra_dsl.language.behavior_trees.catalogue import (
    AUTOREMAP,
    BUILT_IN,
    POST_SCRIPTS,
    PRECONDITIONS,
    BuiltIn,
    BuiltInPort,
    PortContent,
)
from codra_dsl.language.behavior_trees.ports import EntryKey, parse_port_value
from codra_dsl.language.behavior_trees.scripts import ScriptProblem, parse_condition, parse_script
from codra_dsl.language.expression import And, Or
from codra_dsl.language.expression import Node as Script
from codra_dsl.language.project import GENERATED_API

__all__ = [
    "tree_module",
]

_EXPORTED_NAMES: Mapping[str, str] = {"Node": "TreeNode", "Precondition": "TreePrecondition"}
"""A mapping from words that mean something else in other generated modules to their names in `generated_api`."""

_PYTHON_NAMES = {"else": "otherwise"}
_RETURN = "    return "


def tree_module(checked: CheckedForest) -> str:
    """Return the text of the module with the trees of a file and of the files that it includes."""
    return _Writer(checked).module()


class _Writer:
    """Writes one module."""

    def __init__(self, checked: CheckedForest) -> None:
        self._trees = checked.forest.trees
        self._file = checked.forest.files[0].file
        self._main = checked.forest.main
        self._enums = dict(checked.enums)
        self._models = {(model.kind is NodeKind.SUBTREE, model.id): model for model in checked.forest.models}
        self._functions = _function_names(tree.id for tree in self._trees)
        self._imported_names: set[str] = {"Node"}
        self._tree = ""
        self._helpers: list[str] = []

    def module(self) -> str:
        """Return the text of the module."""
        functions = [self._function(tree) for tree in self._trees]
        nodes = (node for tree in self._trees for node in tree.root.walk())
        actions = sorted({node.id for node in nodes if node.id not in BUILT_IN and not node.children})
        trees = spread_dictionary({literal(tree.id): self._functions[tree.id] for tree in self._trees})
        main = "None" if self._main is None else literal(self._main)
        parts = [
            f'"""Behaviour trees of {prose(self._file)}.\n\nMade by codra; edits are lost.\n"""\n\n',
            self._imports(),
            *(f"\n\n{text}" for text in functions),
            f"\n\nTREES: Mapping[str, Callable[[], Node]] = {lay_out(trees)}\n",
            f"\nMAIN: str | None = {main}\n",
            f"\nACTIONS: tuple[str, ...] = {lay_out(spread_tuple(map(literal, actions)))}\n",
        ]
        return "".join(parts)

    def _imports(self) -> str:
        """Return the import statements. Each renamed import is a separate statement after the others, as in ruff."""
        renamed_imports = [
            f"{_EXPORTED_NAMES[word]} as {word}" for word in sorted(self._imported_names & _EXPORTED_NAMES.keys())
        ]
        import_statements = [
            import_statement(GENERATED_API, names)
            for names in (self._imported_names - _EXPORTED_NAMES.keys(), *zip(renamed_imports))
        ]
        return "from collections.abc import Callable, Mapping\n\n" + "\n".join(import_statements) + "\n"

    def _function(self, tree: BehaviorTree) -> str:
        self._helpers = []
        self._tree = name = self._functions[tree.id]
        root = lay_out(self._node(tree.root), indent=4, before=len(_RETURN))
        text = f'def {name}() -> Node:\n    """Return the tree {prose(tree.id)}."""\n{_RETURN}{root}\n'
        return "\n\n".join([*self._helpers, text])

    def _node(self, node: TreeNode) -> Expression:
        children = [self._node(child) for child in node.children]
        if node.subtree is not None:
            children = [f"{self._functions[node.subtree]}()"]
        keywords = self._conditions(node)
        make = spread_call if children else call
        return make("Node", literal(node.label), self._kind(node), *children, **keywords)

    def _conditions(self, node: TreeNode) -> dict[str, Expression]:
        condition_texts = {attribute.name: attribute.value for attribute in node.conditions}
        preconditions = {
            name: self._condition_function(condition_texts[key])
            for key, name in PRECONDITIONS.items()
            if key in condition_texts
        }
        post_scripts = {
            name: tuple_of(self._statements(condition_texts[key]))
            for key, name in POST_SCRIPTS.items()
            if key in condition_texts
        }
        return {"conditions": self._call("Conditions", **preconditions, **post_scripts)} if condition_texts else {}

    # Kinds

    def _kind(self, node: TreeNode) -> Expression:
        if node.subtree is not None:
            return self._subtree(node)
        if node.id in BUILT_IN:
            return self._built_in(node, BUILT_IN[node.id])
        return self._robot_node(node)

    def _built_in(self, node: TreeNode, built_in: BuiltIn) -> Expression:
        values = {attribute.name: attribute.value for attribute in node.ports}
        if node.id == "Script":
            return self._call(built_in.word, *self._statements(values["code"]))
        ports_with_value = [port for port in built_in.ports if port.name in values]
        positional_arguments = [
            self._port(port, values[port.name]) for port in ports_with_value if port.default is None
        ]
        keywords = {
            _PYTHON_NAMES.get(port.name, port.name): self._port(port, values[port.name])
            for port in ports_with_value
            if port.default is not None
        }
        if built_in.word == "Switch" and self._enums:
            pairs = (tuple_of([literal(name), literal(value)]) for name, value in self._enums.items())
            keywords["enums"] = tuple_of(pairs)
        return self._call(built_in.word, *positional_arguments, **keywords)

    def _port(self, port: BuiltInPort, value: str) -> Expression:
        if port.content is PortContent.CONDITION:
            return self._condition_function(value)
        setting = parse_port_value(port.name, value)
        if port.content in (PortContent.ENTRY, PortContent.KEY):
            return literal(setting.key if isinstance(setting, EntryKey) else value)
        return self._setting(setting)

    def _setting(self, setting: EntryKey | str | None) -> Expression:
        return self._call("Entry", literal(setting.key)) if isinstance(setting, EntryKey) else literal(setting or "")

    def _robot_node(self, node: TreeNode) -> Expression:
        """Return a node of the robot: with children, it is a control node or a decorator."""
        model = self._models.get((False, node.id))
        values = _port_values(node, model)
        inputs = {
            name: parse_port_value(name, value)
            for name, value in values.items()
            if _has_direction(model, name, Direction.IN)
        }
        outputs = {
            name: parse_port_value(name, value)
            for name, value in values.items()
            if _has_direction(model, name, Direction.OUT)
        }
        entries = {name: setting for name, setting in outputs.items() if isinstance(setting, EntryKey)}
        keywords: dict[str, Expression] = {}
        if inputs:
            keywords["inputs"] = self._settings(inputs)
        if entries:
            keywords["outputs"] = self._settings(entries)
        return self._call("Control" if node.children else "Leaf", literal(node.id), **keywords)

    def _settings(self, settings: Mapping[str, EntryKey | str | None]) -> Expression:
        return dictionary({literal(name): self._setting(setting) for name, setting in settings.items()})

    def _subtree(self, node: TreeNode) -> Expression:
        values = _port_values(node, self._models.get((True, str(node.subtree))))
        remaps_all = values.pop(AUTOREMAP, "false") in ("true", "1")
        settings = {name: parse_port_value(name, value) for name, value in values.items()}
        remapped_keys = {
            literal(name): literal(setting.key) for name, setting in settings.items() if isinstance(setting, EntryKey)
        }
        constants = {literal(name): literal(text) for name, text in settings.items() if isinstance(text, str)}
        keywords: dict[str, Expression] = {}
        if remapped_keys:
            keywords["remapped"] = dictionary(remapped_keys)
        if constants:
            keywords["constants"] = dictionary(constants)
        if remaps_all:
            keywords["remaps_all"] = "True"
        return self._call("Subtree", **keywords)

    # Scripts

    def _condition_function(self, text: str) -> Expression:
        node = parse_condition(text)
        if isinstance(node, ScriptProblem):
            raise TypeError(f"{text!r} was checked, but is not a condition")
        return self._script(node, truth_text(node, self._enums))

    def _statements(self, text: str) -> Iterator[Expression]:
        statements = parse_script(text)
        if isinstance(statements, ScriptProblem):
            raise TypeError(f"{text!r} was checked, but is not a script")
        for statement in statements:
            value = self._script(statement.value, value_text(statement.value, self._enums))
            yield self._call("create" if statement.creates else "assign", literal(statement.entry), value)

    def _script(self, node: Script, text: str) -> Expression:
        """Return a script as a function: a lambda, or, if the script is long, the name of a helper function."""
        if len(text) <= SHORT_TEXT_LENGTH:
            return f"lambda it: {text}"
        self._imported_names.add("Scope")
        body: Expression = text
        if isinstance(node, And | Or) and text == truth_text(node, self._enums):
            first, *rest = operand_texts(node, self._enums)
            operator = "and" if isinstance(node, And) else "or"
            body = Grouped("", Chain(first, tuple((operator, operand) for operand in rest)))
        is_within_width = len(_RETURN) + len(text) <= WIDTH
        name = f"_script_{len(self._helpers) + 1}_of_{self._tree}"
        body_text = text if is_within_width else lay_out(body, indent=4, before=WIDTH)
        self._helpers.append(f"def {name}(it: Scope) -> object:\n{_RETURN}{body_text}\n")
        return name

    def _call(self, word: str, *arguments: Expression, **keywords: Expression) -> Expression:
        self._imported_names.add(word)
        return call(word, *arguments, **keywords)


def _port_values(node: TreeNode, model: NodeModel | None) -> dict[str, str]:
    """Return the values of a node's ports. A port that the node does not set has the default of the node's model."""
    ports = model.ports if model is not None else ()
    port_values = {attribute.name: attribute.value for attribute in node.ports}
    defaults = {port.name: port.default for port in ports if port.default is not None and port.name not in port_values}
    return {**defaults, **port_values}


def _has_direction(model: NodeModel | None, name: str, direction: Direction) -> bool:
    """Return whether a port has a direction; a port without a model has both directions."""
    port = model.port(name) if model is not None else None
    return port is None or port.direction in (direction, Direction.BOTH)


def _function_names(ids: Iterable[str]) -> dict[str, str]:
    """Return a unique Python name for each tree, made from its id in lower case."""
    names: dict[str, str] = {}
    for id_ in dict.fromkeys(ids):
        words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", id_)
        name = re.sub(r"[^a-z0-9]+", "_", words.lower()).strip("_").removesuffix("_tree") or "unnamed"
        name = f"{name}_tree" if name[0].isalpha() else f"tree_{name}_tree"
        taken_names = set(names.values())
        numbered_names = (f"{name}_{number}" for number in range(2, len(taken_names) + 3))
        names[id_] = (
            name
            if name not in taken_names
            else next(candidate for candidate in numbered_names if candidate not in taken_names)
        )
    return names
