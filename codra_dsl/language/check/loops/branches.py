"""Checks of trees: files of trees (phase 1), and branches for actions and executors of leaves (phase 4)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from codra_dsl.language.behavior_trees import BehaviorTree, CheckedForest, Forest, TreeNode
from codra_dsl.language.behavior_trees.catalogue import BUILT_IN
from codra_dsl.language.behavior_trees.named import UNREAD_RESULT
from codra_dsl.language.behavior_trees.ports import EntryKey, parse_port_value
from codra_dsl.language.behavior_trees.scripts import parse_condition
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.diagnostics import Diagnostic, Place, Related, has_errors
from codra_dsl.language.expression import Compare, Name, Node, Text
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model import Course, TreeElement


@dataclass(frozen=True, slots=True)
class Branch:
    """A guarded branch of a tree.

    Attributes:
        entry: the entry of the blackboard that selects the branch.
        value: the branch runs while the entry has this value; empty for the default branch.
        excluded_values: values of the entry with which the default branch does not run; empty for other branches.
        tree: the ID of the tree that the branch runs.
    """

    entry: str
    value: str
    tree: str
    place: Place
    excluded_values: tuple[str, ...] = ()


def branches(forest: Forest) -> tuple[Branch, ...]:
    """Return the guarded branches of the main tree of a file."""
    main = main_tree(forest)
    return () if main is None else tuple(branch for node in main.root.walk() for branch in _guarded_branches(node))


def main_tree(forest: Forest) -> BehaviorTree | None:
    """Return the main tree of a file, or None if the file does not contain it."""
    return next((tree for tree in forest.trees if tree.id == forest.main), None)


def _guarded_branches(node: TreeNode) -> Iterator[Branch]:
    """Yield the branches of a switch, or the single branch of a subtree that has a guard."""
    built_in = BUILT_IN.get(node.id)
    ports = {port.name: port.value for port in node.ports}
    if built_in is not None and built_in.word == "Switch":
        entry = parse_port_value("variable", ports.get("variable", ""))
        cases = [ports[key] for key in sorted(ports) if key.startswith("case_")]
        for index, child in enumerate(node.children):
            if isinstance(entry, EntryKey) and child.subtree is not None:
                is_last = index >= len(cases)
                value, excluded_values = ("", tuple(cases)) if is_last else (cases[index], ())
                yield Branch(entry.key, value, child.subtree, child.place, excluded_values)
    elif node.subtree is not None:
        guard = next((condition.value for condition in node.conditions if condition.name == "_while"), "")
        equality = _equality(parse_condition(guard)) if guard else None
        if equality is not None:
            yield Branch(*equality, node.subtree, node.place)


def _equality(condition: object) -> tuple[str, str] | None:
    """Return the entry and the text that a guard compares; None if the guard has another form."""
    if not isinstance(condition, Compare) or len(condition.rest) != 1:
        return None
    sides: list[Node] = [condition.first, condition.rest[0][1]]
    names = [side.name for side in sides if isinstance(side, Name)]
    texts = [side.value for side in sides if isinstance(side, Text)]
    is_equal = str(condition.rest[0][0]) == "=="
    return (names[0], texts[0]) if is_equal and len(names) == len(texts) == 1 else None


def chosen_values(tree: TreeElement, forest: Forest) -> tuple[str, Mapping[str, str]]:
    """Return the entry that selects a branch of a tree, and a mapping from each action to the value of this entry."""
    branches_by_tree = {branch.tree: branch for branch in branches(forest)}
    branches_by_action = {
        action.name: branches_by_tree[id_.name] for action, id_ in tree.course if id_.name in branches_by_tree
    }
    entry = next((branch.entry for branch in branches_by_action.values()), "course")
    return entry, {
        action: branch.value or (action if action not in branch.excluded_values else "")
        for action, branch in branches_by_action.items()
    }


def leaves(forest: Forest) -> Mapping[str, TreeNode]:
    """Return a mapping from the ID of each leaf that is not built in to the first leaf with this ID, in file order.

    Control nodes and decorators of the robot are not leaves: they have children.
    """
    first_leaves: dict[str, TreeNode] = {}
    for tree in forest.trees:
        for node in tree.root.walk():
            if node.id not in BUILT_IN and node.subtree is None and not node.children:
                first_leaves.setdefault(node.id, node)
    return first_leaves


def tree_files(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """Yield the findings about the files of trees."""
    for tree in spec_index.spec.trees:
        yield from spec_index.forests.get(tree.name, UNREAD_RESULT)[1]


def unmatched_branches(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Every action of a course has a branch, every branch has an action, and one entry selects all of them."""
    courses: dict[str, dict[str, Course]] = {}
    for adaptation in spec_index.spec.adaptation:
        if isinstance(adaptation.does, Course):
            courses.setdefault(adaptation.does.within.name, {})[adaptation.name] = adaptation.does
    for tree in spec_index.spec.trees:
        forest = _sound_forest(spec_index, faults, tree)
        if forest is None or not spec_index.is_readable("trees", tree.name, "course"):
            continue
        yield from _wrong_branch_findings(tree, forest.forest)
        courses_of_tree = courses.get(tree.name, {})
        yield from _findings_of_branches_without_action(tree, [*courses_of_tree.values()])
        for name, course in courses_of_tree.items():
            yield from _findings_of_actions_without_branch(tree, name, course)


def _sound_forest(spec_index: SpecIndex, faults: FaultyElements, tree: TreeElement) -> CheckedForest | None:
    forest, findings = spec_index.forests.get(tree.name, UNREAD_RESULT)
    return None if has_errors(findings) or not faults.is_sound("trees", tree.name) else forest


def _wrong_branch_findings(tree: TreeElement, forest: Forest) -> Iterator[Diagnostic]:
    tree_ids = {forest_tree.id for forest_tree in forest.trees}
    branches_by_tree = {branch.tree: branch for branch in branches(forest)}
    entries: dict[str, str] = {}
    for action, id_ in tree.course:
        path = f"trees.{tree.name}.course.{action.name}"
        branch = branches_by_tree.get(id_.name)
        if id_.name not in tree_ids:
            message = f"there is no tree '{id_.name}' in '{tree.file.name}'"
            yield _branch_finding(message, id_.place, path, f"the trees in the file are {', '.join(sorted(tree_ids))}")
        elif branch is None:
            message = f"tree '{id_.name}' is not a branch that can be chosen: it has no guard in '{forest.main}'"
            help = "make the tree a child of a Switch, or add _while=\"course == 'NAME'\" to it"
            yield _branch_finding(message, id_.place, path, help)
        else:
            first = entries.setdefault("", branch.entry)
            if first != branch.entry:
                message = f"branch '{id_.name}' uses entry '{branch.entry}', and other branches use '{first}'"
                yield _branch_finding(message, id_.place, path, "use the same entry in all branches")
    if tree.course and all(id_.name in tree_ids for _, id_ in tree.course):
        mapped_trees = {id_.name for _, id_ in tree.course}
        for branch in branches_by_tree.values():
            if branch.tree not in mapped_trees and branch.entry == entries.get("", branch.entry):
                message = f"no action chooses branch '{branch.tree}' of tree '{tree.name}'"
                related = (Related("the branch", branch.place),)
                place, path = tree.places.get("course", tree.place), f"trees.{tree.name}.course"
                yield _branch_finding(message, place, path, f"add 'ACTION: {branch.tree}' under 'course'", related)


def _findings_of_branches_without_action(tree: TreeElement, courses: list[Course]) -> Iterator[Diagnostic]:
    chosen_actions = {reference.name for course in courses for reference in course.choose}
    for action, _ in tree.course:
        if action.name not in chosen_actions:
            message = (
                f"tree '{tree.name}' has a branch for action '{action.name}', "
                "but no adaptation of this tree chooses the action"
            )
            help = "add the action to 'choose', or remove the branch"
            yield _branch_finding(message, action.place, f"trees.{tree.name}.course.{action.name}", help)


def _findings_of_actions_without_branch(tree: TreeElement, name: str, course: Course) -> Iterator[Diagnostic]:
    mapped_actions = {action.name for action, _ in tree.course}
    for reference in course.choose:
        if reference.name not in mapped_actions:
            message = f"action '{reference.name}' of adaptation '{name}' has no branch in tree '{tree.name}'"
            related = (Related("the tree", tree.place),)
            help = f"add '{reference.name}: TREE' to 'course' of the tree"
            yield _branch_finding(message, reference.place, f"adaptation.{name}.choose", help, related)


def _branch_finding(message: str, place: Place, path: str, help: str, related: tuple[Related, ...] = ()) -> Diagnostic:
    return finding("unmatched-branch", message, place, path=path, help=help, related=related)


def idle_leaves(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """For every leaf, its tree states which tasks the leaf hands over, and the tree's agent may request these tasks."""
    tasks = {task.name: task for task in spec_index.spec.tasks}
    for tree in spec_index.spec.trees:
        forest = _sound_forest(spec_index, faults, tree)
        if forest is None or not spec_index.is_readable("trees", tree.name, "leaves"):
            continue
        forest_leaves = leaves(forest.forest)
        leaf_entries = {entry.leaf.name: entry for entry in tree.leaves}
        for id_, node in forest_leaves.items():
            if id_ not in leaf_entries:
                message = f"nothing executes leaf '{id_}' of tree '{tree.name}'"
                help = f"add '{id_}: [TASK]' to 'leaves' of the tree, or '{id_}: []' if its code does everything"
                related = (Related("the tree", tree.place),)
                path = f"trees.{tree.name}.leaves"
                yield finding("leaf-without-executor", message, node.place, path=path, help=help, related=related)
        for entry in tree.leaves:
            path = f"trees.{tree.name}.leaves.{entry.leaf.name}"
            if entry.leaf.name not in forest_leaves:
                message = f"tree '{tree.name}' has no leaf '{entry.leaf.name}'"
                help = f"the leaves of the tree are {', '.join(forest_leaves)}" if forest_leaves else "remove it"
                yield finding("leaf-without-executor", message, entry.leaf.place, path=path, help=help)
            for reference in entry.tasks:
                task = tasks.get(reference.name)
                has_task_and_agent = task is not None and tree.agent is not None
                if (
                    has_task_and_agent
                    and task
                    and tree.agent
                    and tree.agent.name not in (requester.name for requester in task.requesters)
                ):
                    message = f"agent '{tree.agent.name}' may not request task '{task.name}'"
                    help = f"add the agent to 'requesters' of '{task.name}', or let another agent execute the tree"
                    related = (Related("the task", task.place),)
                    yield finding(
                        "leaf-without-executor", message, reference.place, path=path, help=help, related=related
                    )
                elif tree.agent is None:
                    message = f"leaf '{entry.leaf.name}' hands over '{reference.name}', but the tree has no agent"
                    help = "add the key 'agent' to the tree: this agent requests the task"
                    yield finding("leaf-without-executor", message, reference.place, path=path, help=help)


TREE_FILE_CHECKS = (tree_files,)
"""The checks of phase 1."""

BRANCH_CHECKS = (unmatched_branches, idle_leaves)
"""The checks of phase 4."""
