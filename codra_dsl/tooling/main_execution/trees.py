"""The decisions of behavior trees of BehaviorTree.CPP: conditions, preconditions, switches and guards."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from codra_dsl.language.behavior_trees import Attribute, BehaviorTree, Forest, NodeKind, TreeNode
from codra_dsl.language.behavior_trees.catalogue import BUILT_IN, POST_SCRIPTS, PRECONDITIONS
from codra_dsl.language.behavior_trees.folders import check_files
from codra_dsl.language.behavior_trees.ports import EntryKey, parse_port_value
from codra_dsl.language.behavior_trees.scripts import ScriptProblem, parse_condition, parse_script
from codra_dsl.language.diagnostics import Diagnostic, Place, Span
from codra_dsl.language.expression.tree import (
    And,
    Arithmetic,
    Choice,
    Compare,
    Name,
    Negative,
    Node,
    Not,
    Number,
    Or,
    Text,
)
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.project import relative_path
from codra_dsl.tooling.main_execution.model import (
    Decision,
    DecisionCollector,
    MainExecution,
    Names,
    Role,
    SourceError,
    ValueType,
)

_NAV2_CONDITIONS = (
    "DistanceTraveled|GlobalUpdatedGoal|GoalReached|GoalUpdated|InitialPoseReceived|PathExpiringTimer|TimeExpired|"
    "TransformAvailable|WouldA[A-Z][a-z]+RecoveryHelp"
)
"""The conditions in Nav2's list of nodes whose names do not show it. Nav2's files of trees declare no nodes."""

_CONDITION_NAME = re.compile(
    rf"(?:Is|Are|Has|Have|Can|Was|Check)(?=[A-Z_0-9]|[^\x00-\x7f])|(?:is|are|has|have|can|was|check)_|(?:{_NAV2_CONDITIONS})$"
)
"""How the names of conditions begin, for nodes that nothing declares."""

_REACTIVE = frozenset({"ReactiveSequence", "ReactiveFallback", "PipelineSequence"})
"""The nodes that ask their earlier children again while a later child runs."""

_SWITCHES = frozenset(node for node in BUILT_IN if node.startswith("Switch"))
_PORT_OF_CONDITION = {"ScriptCondition": "code", "Precondition": "if"}
_HOLDING = "_while"
_ENTRY = "entry"
_LOOP = "WhileDoElse"


def read_trees(
    paths: Sequence[Path], models: Sequence[Path], root: Path
) -> tuple[MainExecution, tuple[Diagnostic, ...]]:
    """Return the decisions of files of trees, and the findings about these files.

    Args:
        paths: files of trees, and folders with such files.
        models: files whose `TreeNodesModel` declares nodes.
        root: the folder to which paths in places are relative.

    Raises:
        SourceError: if there is no file of trees, or if there are too many decisions.
    """
    checked_files = check_files(paths, models, root)
    if not (checked_files.forests or checked_files.diagnostics):
        file = relative_path(paths[0], root)
        message = f"there is no file of trees in '{file}' or below"
        raise SourceError(
            message, Place(Span(file, 1, 1, 1, 1)), help="name a file of trees, or a folder with such files"
        )
    reader = _Reader()
    for forest in checked_files.forests:
        reader.read(forest)
    return reader.main_execution(), checked_files.diagnostics


@dataclass(frozen=True, slots=True, kw_only=True)
class _Asked:
    """Something that a tree asks, before the skill is known for which it asks.

    Attributes:
        key: what distinguishes the variable from others.
        words: the words of the variable's name.
        is_guard: whether it is asked again while the node runs that asks.
    """

    key: tuple[str, ...]
    words: tuple[str, ...]
    text: str
    place: Place
    is_guard: bool = False
    type: ValueType = ValueType.BOOL
    call: str = ""


class _Reader:
    """Reads forests; a tree that several forests share is read once."""

    def __init__(self) -> None:
        self._collector = DecisionCollector()
        self._variables = Names("condition")
        self._skills = Names("skill")
        self._read_places: set[Place] = set()
        self._kinds: Mapping[str, NodeKind] = {}
        self._decided_entries: set[str] = set()
        self._added_guards: dict[tuple[str, int], list[_Asked]] = {}
        self._asked: dict[int, list[_Asked]] = {}
        self._waiting: list[_Asked] = []
        self._last_action: tuple[str, Place] | None = None
        self._written: list[tuple[Attribute, str, str, Place]] = []

    def main_execution(self) -> MainExecution:
        """Return the decisions, with the actions that write an entry on which something decides."""
        for attribute, entry, skill, skill_place in self._written:
            if entry in self._decided_entries:
                asked = _asked_of_entry(entry, ValueType.BOOL, attribute)
                self._add(asked, skill, skill_place, Role.EFFECT, is_made=False)
        return self._collector.main_execution()

    def read(self, forest: Forest) -> None:
        self._kinds = {model.id: model.kind for model in forest.models if model.kind is not NodeKind.SUBTREE}
        for tree in forest.trees:
            if tree.place not in self._read_places:
                self._read_places.add(tree.place)
                self._read_tree(tree)

    def _read_tree(self, tree: BehaviorTree) -> None:
        """Add the decisions of a tree.

        A decision belongs to the next action in the order of the file. If no action follows, it is made for the result
        of the last action, or for the tree if it has no action at all.
        """
        self._waiting, self._last_action = [], None
        self._walk(tree.root, [])
        skill = self._last_action or (self._skills.name((tree.id,), (tree.id,)), tree.place)
        role = Role.PRECONDITION if self._last_action is None else Role.EFFECT
        for asked in self._waiting:
            self._add(asked, *skill, role)

    def _walk(self, node: TreeNode, guards: list[_Asked]) -> None:
        """Walk through a node and the nodes below it; `guards` are asked again while its actions run."""
        asked_here = self._asked_by(node)
        self._waiting += (asked for asked in asked_here if not asked.is_guard)
        guards = _joined(guards, [asked for asked in asked_here if asked.is_guard])
        if self._is_action(node):
            self._add_action(node, guards)
        for number, child in enumerate(node.children):
            self._walk(child, guards)
            if number < len(node.children) - 1 and (node.id in _REACTIVE or (node.id == _LOOP and number == 0)):
                inner_nodes = (inner for inner in child.walk() if not self._is_action(inner))
                guards = _joined(guards, [asked for inner in inner_nodes for asked in self._asked_by(inner)])

    def _add_action(self, node: TreeNode, guards: list[_Asked]) -> None:
        name = node.subtree or node.id
        self._last_action = skill = self._skills.name((name,), (name,)), node.place
        guard_keys = {(guard.key, guard.place) for guard in guards}
        for asked in self._waiting:
            if (asked.key, asked.place) not in guard_keys:
                self._add(asked, *skill, Role.PRECONDITION)
        key = (skill[0], id(guards))
        if key not in self._added_guards:  # an action often occurs several times among the same guards
            self._added_guards[key] = guards
            for guard in guards:
                self._add(guard, *skill, Role.HOLD)
        self._waiting = []
        self._written += ((attribute, entry, *skill) for attribute, entry in _written_entries(node))

    def _add(self, asked: _Asked, skill: str, skill_place: Place, role: Role, *, is_made: bool = True) -> None:
        if asked.key[0] == _ENTRY:
            self._decided_entries.add(asked.key[1])
        decision = Decision(
            name=self._variables.name(asked.key, asked.words),
            text=asked.text,
            skill=skill,
            role=role,
            place=asked.place,
            type=asked.type,
            call=asked.call,
            is_made=is_made,
        )
        self._collector.add(decision, skill_place)

    def _asked_by(self, node: TreeNode) -> list[_Asked]:
        """Return what a node asks, without the nodes below it."""
        if id(node) not in self._asked:
            self._asked[id(node)] = list(_asked_by_attributes(node))
            if not node.children and node.id not in BUILT_IN and self._kind(node) is NodeKind.CONDITION:
                self._asked[id(node)].append(_asked_by_condition(node))
        return self._asked[id(node)]

    def _is_action(self, node: TreeNode) -> bool:
        is_own_leaf = not node.children and node.id not in BUILT_IN
        return node.subtree is not None or (is_own_leaf and self._kind(node) is NodeKind.ACTION)

    def _kind(self, leaf: TreeNode) -> NodeKind:
        kind_by_name = NodeKind.ACTION if _CONDITION_NAME.match(leaf.id) is None else NodeKind.CONDITION
        return leaf.kind or self._kinds.get(leaf.id, kind_by_name)


def _joined(guards: list[_Asked], new_guards: list[_Asked]) -> list[_Asked]:
    """Return both lists as one, or the same list if there are no new guards."""
    return [*guards, *new_guards] if new_guards else guards


def _asked_by_condition(node: TreeNode) -> _Asked:
    """Return what a condition node asks. Its literal ports distinguish it from other nodes with the same id."""
    literals = [port for port in node.ports if isinstance(parse_port_value(port.name, port.value), str)]
    entries = [port for port in node.ports if port not in literals]
    ports_text = "".join(f" {port.name}={port.value!r:.40}" for port in node.ports)
    return _Asked(
        key=("node", node.id, *(f"{port.name}={port.value}" for port in (*literals, *entries))),
        words=(node.id, *(port.value for port in literals)),
        text=f"<{node.id}{ports_text}>",
        place=node.place,
        call=node.id,
    )


def _asked_by_attributes(node: TreeNode) -> Iterator[_Asked]:
    """Yield what preconditions, scripts and switches ask: each entry of the blackboard is a variable."""
    for attribute in node.conditions:
        if attribute.name in PRECONDITIONS:
            yield from _asked_by_script(attribute, is_guard=attribute.name == _HOLDING)
    for port in node.ports:
        if port.name == _PORT_OF_CONDITION.get(node.id):
            yield from _asked_by_script(port)
        value = parse_port_value(port.name, port.value)
        if node.id in _SWITCHES and port.name == "variable" and isinstance(value, EntryKey):
            yield _asked_of_entry(value.key, ValueType.STR, port)


def _asked_by_script(attribute: Attribute, *, is_guard: bool = False) -> Iterator[_Asked]:
    condition = parse_condition(attribute.value)
    if isinstance(condition, ScriptProblem):  # the check of the file reports it
        return
    types: dict[str, ValueType] = {}
    for entry, type_ in _entries(condition, ValueType.BOOL):
        types[entry] = type_ if types.get(entry, ValueType.BOOL) is ValueType.BOOL else types[entry]
    for entry, type_ in types.items():
        yield _asked_of_entry(entry, type_, attribute, is_guard=is_guard)


def _asked_of_entry(entry: str, type_: ValueType, attribute: Attribute, *, is_guard: bool = False) -> _Asked:
    return _Asked(
        key=(_ENTRY, entry),
        words=(entry,),
        text=f'{attribute.name}="{attribute.value:.80}"',
        place=attribute.place,
        is_guard=is_guard,
        type=type_,
    )


def _entries(node: Node, type_: ValueType) -> Iterator[tuple[str, ValueType]]:
    """Yield the entries that a condition reads, with the types that their use shows."""
    match node:
        case Name(name=name):
            yield name, type_
        case Not(operand=operand) | Negative(operand=operand):
            yield from _entries(operand, ValueType.BOOL if isinstance(node, Not) else ValueType.FLOAT)
        case And(operands=operands) | Or(operands=operands):
            for operand in operands:
                yield from _entries(operand, ValueType.BOOL)
        case Compare(first=first, rest=rest):
            sides = (first, *(side for _, side in rest))
            members = [side for side in sides if isinstance(side, Name) and side.name.isupper()]
            for side in sides:
                if len(members) == len(sides) or side not in members:  # `mode == MANUAL` compares with a member
                    yield from _entries(side, ValueType.STR if members else _type_beside(sides))
        case Arithmetic(left=left, right=right):
            for side in (left, right):
                yield from _entries(side, ValueType.FLOAT)
        case Choice(condition=condition, then=then, otherwise=otherwise):
            yield from _entries(condition, ValueType.BOOL)
            for branch in (then, otherwise):
                yield from _entries(branch, type_)


def _type_beside(sides: Iterable[Node]) -> ValueType:
    """Return the type of an entry that is compared with these values."""
    sides = list(sides)
    if any(isinstance(side, Text) for side in sides):
        return ValueType.STR
    return (
        ValueType.FLOAT if any(isinstance(side, Number | Arithmetic | Negative) for side in sides) else ValueType.BOOL
    )


def _written_entries(node: TreeNode) -> Iterator[tuple[Attribute, str]]:
    """Yield the entries that the scripts of an action write after it has run."""
    for attribute in node.conditions:
        statements = parse_script(attribute.value) if attribute.name in POST_SCRIPTS else ()
        if not isinstance(statements, ScriptProblem):
            yield from ((attribute, statement.entry) for statement in statements)
