"""Files as robots in the field have them are read, drawn and written back; conversions and own nodes tick as stated."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from codra_dsl.compiler import plan_paths
from codra_dsl.generation.emit.behaviour_trees import tree_module
from codra_dsl.language.behavior_trees import CheckedForest, Forest, TreeFile, check, read_text, write
from codra_dsl.language.behavior_trees.folders import check_files
from codra_dsl.language.diagnostics import Severity
from codra_dsl.runtime import SimClock
from codra_dsl.runtime.behavior_trees import Kind, Node, Ports, Result, Robot, Tree, TreeError
from codra_dsl.tooling.report.tree_pictures import picture_of
from tests.cli.test_hostile_projects import nested_folders
from tests.language.behavior_trees.documented_texts import BODIES, FILES, REFUSED, documented_file
from tests.language.behavior_trees.nav2_trees import NAV2_TREES
from tests.language.behavior_trees.real_texts import NAV2_BODIES, NAV2_MODELS, TEXTS, nav2_file
from tests.language.behavior_trees.stories import document, findings, functions, main_tree


@pytest.mark.parametrize("name", TEXTS)
def test_a_text_of_the_field_is_read_drawn_compiled_and_written_back(name: str) -> None:
    check_accepted_text(*TEXTS[name])


def check_accepted_text(text: str, rules: list[str]) -> None:
    file, read_problems = read_text(text.encode(), "tree.xml")
    assert file is not None
    checked, problems = check(Forest(files=(file,)))

    assert [problem.rule.name for problem in (*read_problems, *problems)] == rules
    assert {problem.severity for problem in (*read_problems, *problems)} <= {Severity.WARNING}
    assert checked is not None
    check_that_it_is_written_back_compiled_and_drawn(file, checked)


def check_that_it_is_written_back_compiled_and_drawn(file: TreeFile, checked: CheckedForest) -> None:
    written = write(file)
    again, written_problems = read_text(written.encode(), file.file)
    assert again == file
    assert write(again) == written
    assert written_problems == ()
    compile(tree_module(checked), "trees.py", "exec", dont_inherit=True)
    node_count = sum(1 for tree in file.trees for _ in tree.root.walk())
    picture = picture_of([checked.forest])
    assert picture.dot().count(" [label=") == node_count + len(file.trees)
    assert picture.mermaid().startswith("flowchart TB\n")


def project(folder: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, "utf-8")
    return folder


@pytest.mark.parametrize("name", BODIES)
def test_a_documented_construct_is_read_drawn_compiled_and_written_back(name: str) -> None:
    check_accepted_text(documented_file(BODIES[name]), [])


@pytest.mark.parametrize("name", FILES)
def test_a_documented_file_is_read_drawn_compiled_and_written_back(name: str) -> None:
    check_accepted_text(*FILES[name])


@pytest.mark.parametrize("name", REFUSED)
def test_a_refusal_names_the_construct_and_what_to_do(name: str) -> None:
    text, rule, construct = REFUSED[name]
    errors = [finding for finding in findings(text) if finding.severity is Severity.ERROR]

    assert [finding.rule.name for finding in errors] == [rule]
    assert construct in errors[0].message
    assert errors[0].help


def test_the_texts_of_the_field_are_three_hundred_different_ones() -> None:
    bodies = {*BODIES.values(), *NAV2_TREES.values(), *NAV2_BODIES.values()}
    files = {text for text, *_ in (*FILES.values(), *TEXTS.values(), *REFUSED.values())}

    assert len(bodies) + len(files) >= 300


@pytest.mark.parametrize("name", NAV2_TREES)
def test_a_tree_of_the_shape_of_one_of_nav2_needs_only_the_node_list(name: str, tmp_path: Path) -> None:
    check_nav2_tree(NAV2_TREES[name], tmp_path)


@pytest.mark.parametrize("name", NAV2_BODIES)
def test_a_tree_of_nav2_has_no_error_and_with_the_node_list_no_undeclared_node(name: str, tmp_path: Path) -> None:
    check_nav2_tree(NAV2_BODIES[name], tmp_path)


def check_nav2_tree(body: str, folder: Path) -> None:
    models = f'<root BTCPP_format="4"><TreeNodesModel>{NAV2_MODELS}</TreeNodesModel></root>'
    folder = project(folder, {"trees/tree.xml": nav2_file(body), "nav2/nodes.xml": models})
    tree = folder / "trees" / "tree.xml"

    alone = check_files([tree], [], folder / "trees").diagnostics
    declared = check_files([tree], [folder / "nav2" / "nodes.xml"], folder / "trees")

    assert {finding.rule.name for finding in alone} == {"undeclared-tree-node"}
    assert {finding.rule.name for finding in declared.diagnostics} <= {"port-without-value"}
    (forest,) = declared.forests
    checked, _ = check(forest)
    assert checked is not None
    check_that_it_is_written_back_compiled_and_drawn(forest.files[0], checked)


# Conversion


def converted(body: str) -> str:
    """Return the body of the tree Main of version 3 after conversion, in one line."""
    others = '<BehaviorTree ID="Sub"><AlwaysSuccess/></BehaviorTree>'
    text = document(body, "", others).replace('BTCPP_format="4"', 'BTCPP_format="3"')
    file, _ = read_text(text.encode(), "old.xml")
    assert file is not None
    lines = write(file).split('ID="Main">')[1].split("</BehaviorTree>")[0].splitlines()
    return "".join(line.strip() for line in lines)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("<SequenceStar><AlwaysSuccess/></SequenceStar>", "<SequenceWithMemory><AlwaysSuccess/></SequenceWithMemory>"),
        (
            '<Control ID="SequenceStar"><AlwaysSuccess/></Control>',
            '<Control ID="SequenceWithMemory"><AlwaysSuccess/></Control>',
        ),
        ('<SubTree ID="Sub" name="n" a="b" c="{d}"/>', '<SubTree ID="Sub" name="n" a="{b}" c="{d}"/>'),
        ('<Sub name="n" a="b"/>', '<SubTree ID="Sub" name="n" a="{b}"/>'),
        ('<Act go="${a}" to="${not an entry}"/>', '<Act go="{a}" to="${not an entry}"/>'),
        ('<SubTree ID="Sub" __shared_blackboard="true"/>', '<SubTree ID="Sub" _autoremap="true"/>'),
        ('<SubTreePlus ID="Sub" a="b" c="{d}" __autoremap="1"/>', '<SubTree ID="Sub" a="b" c="{d}" _autoremap="1"/>'),
        (
            '<Parallel success_threshold="1" failure_threshold="1"><AlwaysSuccess/></Parallel>',
            '<Parallel success_count="1" failure_count="1"><AlwaysSuccess/></Parallel>',
        ),
        ('<Act threshold="1"/>', '<Act threshold="1"/>'),
    ],
)
def test_a_tree_of_version_3_is_converted(old: str, new: str) -> None:
    assert converted(old) == new


def test_a_node_of_version_3_that_cannot_be_converted_is_refused_at_its_place() -> None:
    body = '<BlackboardCheckInt value_A="{a}" value_B="1"><AlwaysSuccess/></BlackboardCheckInt>'
    text = document(body, "").replace('"4"', '"3"')

    (finding,) = [finding for finding in findings(text) if finding.severity is Severity.ERROR]
    assert (finding.rule.name, finding.help) == ("unsupported-tree-node", "write Precondition with a script")
    assert finding.place.span.column == text.index("<BlackboardCheckInt") + 1


# Values that are not escaped


def test_places_in_a_file_with_values_that_are_not_escaped_are_those_of_the_file() -> None:
    text = document(
        '<Sequence><A _skipIf="1 < 2 && 3 > 2"/>\n<Sleep msec="soon" name="a&&b"/><Sleep mesc="1"/></Sequence>'
    )

    problems = [(problem.place.span.line, problem.place.span.column, problem.rule.name) for problem in findings(text)]
    second_line = text.splitlines()[1]
    assert problems == [
        (1, text.index("1 < 2") + 3, "xml-not-escaped"),
        (2, second_line.index("soon") + 1, "port-value"),
        (2, second_line.index("mesc") + 1, "unknown-port"),
    ]


@pytest.mark.parametrize("text", ["<root a='&nbsp; &&'/>", "<root a='<'><b></root>", "<root a='&'", "<root>&&</root>"])
def test_an_xml_error_beside_a_value_that_is_not_escaped_is_reported_once(text: str) -> None:
    assert [problem.rule.name for problem in findings(text)] == ["xml-syntax"]


# Folders


MAIN = '<root BTCPP_format="4"><BehaviorTree ID="Main"><SubTree ID="{}"/></BehaviorTree></root>'
PART = '<root BTCPP_format="4"><BehaviorTree ID="Main"><AlwaysFailure/></BehaviorTree>{}</root>'
TREE = '<BehaviorTree ID="{}">{}</BehaviorTree>'


def test_a_folder_supplies_trees_of_other_files_although_main_trees_have_one_name(tmp_path: Path) -> None:
    inner = TREE.format("Inner", "<Own/>")
    models = '<root BTCPP_format="4"><TreeNodesModel><Action ID="Own"/><Action ID="Other"/></TreeNodesModel></root>'
    files = {
        "a.xml": MAIN.format("Outer"),
        "b/c.xml": PART.format(TREE.format("Outer", '<SubTree ID="Inner"/>')),
        "b/d.xml": PART.format(inner),
        "b/nodes.xml": models,
        "launch.xml": "<launch/>",
        ".hidden/e.xml": "<root",
    }
    checked = check_files([project(tmp_path, files)], [], tmp_path)

    assert checked.diagnostics == ()
    assert [[file.file for file in forest.files] for forest in checked.forests] == [
        ["a.xml", "b/c.xml", "b/d.xml", "b/nodes.xml"],
        ["b/c.xml", "b/d.xml", "b/nodes.xml"],
        ["b/d.xml", "b/nodes.xml"],
        ["b/nodes.xml"],
    ]
    assert [tree.id for tree in checked.forests[0].trees] == ["Main", "Outer", "Inner"]


def test_a_file_alone_does_not_see_the_files_beside_it(tmp_path: Path) -> None:
    project(tmp_path, {"a.xml": MAIN.format("Outer"), "b.xml": PART.format(TREE.format("Outer", "<AlwaysSuccess/>"))})

    (finding,) = check_files([tmp_path / "a.xml"], [], tmp_path).diagnostics
    assert (finding.rule.name, finding.message) == ("unknown-subtree", "there is no tree 'Outer'")


def test_a_tree_that_several_files_of_a_folder_have_is_reported(tmp_path: Path) -> None:
    part = PART.format(TREE.format("Outer", "<AlwaysSuccess/>"))
    project(tmp_path, {"a.xml": MAIN.format("Outer"), "b.xml": part, "c.xml": part})

    (finding,) = check_files([tmp_path], [], tmp_path).diagnostics
    assert (finding.rule.name, finding.message) == ("duplicate-tree", "2 files have a tree 'Outer'")
    assert [related.place.span.file for related in finding.related] == ["c.xml"]


def test_a_folder_with_a_link_out_of_it_reads_nothing_of_the_target(tmp_path: Path) -> None:
    folder = project(tmp_path, {"trees/a.xml": PART.format(""), "secret.xml": "<root secret"}) / "trees"
    (folder / "link.xml").symlink_to(tmp_path / "secret.xml")

    (finding,) = check_files([folder], [], folder).diagnostics
    assert (finding.rule.name, finding.place.span.file) == ("cannot-read", "link.xml")


def test_a_folder_with_very_deep_folders_and_other_kinds_of_files_is_read(tmp_path: Path) -> None:
    project(tmp_path, {"a.xml": PART.format("")})
    (tmp_path / "folder.xml").mkdir()
    os.mkfifo(tmp_path / "pipe.xml")

    with nested_folders(tmp_path, "d", 1200):
        checked = check_files([tmp_path], [], tmp_path)
    assert checked.diagnostics == ()
    assert [forest.files[0].file for forest in checked.forests] == ["a.xml"]


# Own control nodes and decorators


class Recovery(Kind):
    """Ticks its first child; after a failure, ticks its second child, and then the first one again, some times."""

    def __init__(self, ports: Ports) -> None:
        self._ports = ports
        self._retry_count = 0
        self._index = 0

    def tick(self, node: Node) -> Result:
        while True:
            result = node.nodes[self._index].execute()
            if result is Result.RUNNING:
                return result
            node.nodes[self._index].reset()
            is_done = self._index == 0 and result is Result.SUCCESS
            if is_done or (self._index == 1 and result is Result.FAILURE):
                return self._end(node, result)
            if self._index == 0 and self._retry_count == self._ports.number("number_of_retries"):
                return self._end(node, Result.FAILURE)
            self._retry_count += self._index == 0
            self._index = 1 - self._index

    def halt(self, _: Node) -> None:
        self._retry_count = self._index = 0

    def _end(self, node: Node, result: Result) -> Result:
        self.halt(node)
        node.reset_children()
        return result


RECOVERY = '<RecoveryNode number_of_retries="{retries}" name="r">{first}{second}</RecoveryNode>'


def recovery_tree(robot: Robot) -> Tree:
    body = RECOVERY.format(retries="{n}", first="<A/>", second="<B/>")
    return main_tree(document(f'<Sequence><Script code="n := 2"/>{body}</Sequence>'), robot, clock=SimClock())


def test_an_own_control_node_ticks_as_its_registered_class_does() -> None:
    log: list[str] = []
    results = iter([False, False, True])
    robot = Robot()
    robot.controls("RecoveryNode", Recovery)
    robot.does("A", lambda _: bool(log.append("A")) or next(results))
    robot.does("B", lambda _: not log.append("B"))

    assert recovery_tree(robot).tick() is Result.SUCCESS
    assert log == ["A", "B", "A", "B", "A"]


def test_a_running_own_control_node_is_halted_with_its_children() -> None:
    robot = Robot()
    robot.controls("RecoveryNode", Recovery)
    robot.does("A", lambda _: Result.RUNNING)
    robot.does("B", lambda _: True)
    tree = recovery_tree(robot)

    assert tree.tick() is Result.RUNNING
    tree.halt()
    assert {node.result for node in tree.root.iterate() if isinstance(node, Node)} == {Result.IDLE}


def test_an_own_control_node_without_a_class_is_reported_before_the_first_tick() -> None:
    robot = Robot()
    robot.does("A", lambda _: True)
    robot.does("B", lambda _: True)

    with pytest.raises(
        TreeError, match=r"has no control node 'RecoveryNode': it has none; add it with Robot\.controls"
    ):
        recovery_tree(robot)


def test_a_class_of_a_control_node_is_registered_once_and_returns_no_idle() -> None:
    class Idle(Recovery):
        def tick(self, _: Node) -> Result:
            return Result.IDLE

    robot = Robot()
    robot.controls("RecoveryNode", Idle)
    robot.does("A", lambda _: True)
    robot.does("B", lambda _: True)

    with pytest.raises(ValueError, match="the control node 'RecoveryNode' already exists"):
        robot.controls("RecoveryNode", Recovery)
    with pytest.raises(TreeError, match="'RecoveryNode' returned IDLE"):
        recovery_tree(robot).tick()


def test_own_control_nodes_are_not_actions_of_the_module() -> None:
    file, _ = read_text(document("<Race><A/><B/></Race>").encode(), "race.xml")
    assert file is not None
    checked, _ = check(Forest(files=(file,)))
    assert checked is not None

    names: dict[str, object] = {}
    module = tree_module(checked)
    exec(compile(module, "race.py", "exec"), names)
    assert names["ACTIONS"] == ("A", "B")
    assert list(functions(module)) == ["Main"]


SPEC = """\
codra: 1
name: truck
trees:
  mission: {file: main.xml, leaves: {A: [], B: []}}
loops:
  driving: {execute: [mission]}
"""


def test_a_spec_whose_tree_has_an_own_control_node_is_planned_and_lists_only_its_leaves(tmp_path: Path) -> None:
    project(tmp_path, {"main.xml": document("<Race><A/><B/></Race>"), "spec.yaml": SPEC})
    planned = plan_paths([tmp_path / "spec.yaml"], tmp_path)

    assert [finding.rule.name for finding in planned.diagnostics] == ["undeclared-tree-node"]
    assert [plan.name for plan in planned.plans] == ["truck"]


# Entries without a value


def test_set_blackboard_fails_as_long_as_the_entry_that_it_copies_is_empty() -> None:
    copy = '<SetBlackboard value="{a}" output_key="b"/>'
    tree = main_tree(document(f'<Fallback>{copy}<Script code="a = 5"/></Fallback>', ""), Robot())

    assert tree.tick() is Result.SUCCESS
    assert not tree.scope.has("b")
    assert tree.tick() is Result.SUCCESS
    assert tree.scope.get("b") == 5


def test_set_blackboard_raises_for_an_entry_that_was_removed() -> None:
    body = '<Sequence><UnsetBlackboard key="a"/><SetBlackboard value="{a}" output_key="b"/></Sequence>'

    with pytest.raises(TreeError, match="the entry 'a' does not exist"):
        main_tree(document(body, ""), Robot()).tick()


def test_a_loop_takes_its_items_from_the_text_that_a_subtree_is_given() -> None:
    loop = '<LoopDouble queue="{queue}" value="{v}"><A v="{v}"/></LoopDouble>'
    others = f'<BehaviorTree ID="Loop">{loop}</BehaviorTree>'
    taken: list[float] = []
    robot = Robot()
    robot.does("A", lambda ports: not taken.append(ports.number("v")))
    model = '<Action ID="A"><input_port name="v"/></Action>'
    tree = main_tree(document('<SubTree ID="Loop" queue="1;2.5;3"/>', model, others), robot)

    results = [tree.tick_exactly_once() for _ in range(4)]
    assert results == [Result.RUNNING] * 3 + [Result.SUCCESS]
    assert taken == [1, 2.5, 3]
    assert tree.tick_exactly_once() is Result.SUCCESS  # the library does not read the text again
    assert taken == [1, 2.5, 3]


def test_a_loop_refuses_a_text_with_an_item_of_another_type() -> None:
    body = '<Sequence><Script code="q := \'1;x\'"/><LoopInt queue="{q}"><AlwaysSuccess/></LoopInt></Sequence>'

    with pytest.raises(TreeError, match="cannot read the item 'x'"):
        main_tree(document(body, ""), Robot()).tick()


# Pictures


def test_a_picture_has_names_ids_and_conditions_and_connects_subtrees_with_their_trees() -> None:
    others = '<BehaviorTree ID="Sub"><Fallback name="try"><A/><Every><B/></Every></Fallback></BehaviorTree>'
    text = document('<SubTree ID="Sub" _skipIf="done == true"/>', '<Condition ID="A"/><Action ID="B"/>', others)
    file, _ = read_text(text.encode(), "tree.xml")
    assert file is not None

    picture = picture_of([Forest(files=(file,))])
    assert picture.mermaid().splitlines() == [
        "flowchart TB",
        '  subgraph t0["Main"]',
        '    n0[["Sub<br/>skipIf#58; done #61;#61; true"]]',
        "  end",
        '  subgraph t1["Sub"]',
        '    n1["try<br/>Fallback"]',
        '    n2(["A"])',
        '    n3{{"Every"}}',
        '    n4("B")',
        "    n1 --> n2",
        "    n1 --> n3",
        "    n3 --> n4",
        "  end",
        "  n0 -.-> n1",
    ]
    assert 'n0 -> n1 [style="dashed", constraint="false"];' in picture.dot()
    assert picture_of([Forest(files=(file,))], ["Main"]).mermaid().count("subgraph") == 1


def test_a_picture_is_drawn_as_svg() -> None:
    file, _ = read_text(document('<Sequence name="a &lt; b"><A/><B/></Sequence>').encode(), "tree.xml")
    assert file is not None

    svg = picture_of([Forest(files=(file,))]).svg()
    assert svg.startswith("<svg ")
    assert "a &lt; b" in svg
