"""The names of the entries that occur in nodes."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.language.behavior_trees.catalogue import BUILT_IN, PRECONDITIONS, PortContent
from codra_dsl.language.behavior_trees.ports import EntryKey, parse_port_value
from codra_dsl.language.behavior_trees.scripts import ScriptProblem, parse_condition, parse_script
from codra_dsl.language.behavior_trees.values import NodeModel, TreeNode
from codra_dsl.language.expression import names_in


def entries_of_node(node: TreeNode, model: NodeModel | None) -> Iterator[str]:
    """Yield the names of all entries that occur in a node."""
    port_contents = {port.name: port.content for port in BUILT_IN[node.id].ports} if node.id in BUILT_IN else {}
    defaults = {port.name: port.default for port in model.ports if port.default is not None} if model else {}
    values = defaults | {attribute.name: attribute.value for attribute in node.ports}
    for name, value in values.items():
        port_value = parse_port_value(name, value)
        if port_contents.get(name) in (PortContent.CONDITION, PortContent.SCRIPT):
            yield from _entries_in_script(value, is_condition=port_contents[name] is PortContent.CONDITION)
        elif isinstance(port_value, EntryKey):
            yield port_value.key
        elif port_contents.get(name) in (PortContent.KEY, PortContent.ENTRY):
            yield value
    for attribute in node.conditions:
        yield from _entries_in_script(attribute.value, is_condition=attribute.name in PRECONDITIONS)


def _entries_in_script(text: str, *, is_condition: bool) -> Iterator[str]:
    if is_condition:
        condition = parse_condition(text)
        yield from () if isinstance(condition, ScriptProblem) else (name.name for name in names_in(condition))
        return
    statements = parse_script(text)
    for statement in () if isinstance(statements, ScriptProblem) else statements:
        yield statement.entry
        yield from (name.name for name in names_in(statement.value))
