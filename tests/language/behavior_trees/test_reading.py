"""All mistakes in a file of trees are reported at once, with place and help; hostile files are refused."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.compiler import plan_paths
from codra_dsl.language.behavior_trees import RULES, Forest, check, read, read_text
from codra_dsl.language.behavior_trees.catalogue import BUILT_IN, REFUSED_NODES
from codra_dsl.language.behavior_trees.elements import MAX_BYTES, MAX_DEPTH, MAX_ELEMENTS
from codra_dsl.language.diagnostics import Severity
from tests.language.behavior_trees.stories import document, findings, places_and_rules

MOVE = """<Action ID="Move"><input_port name="goal" type="double"/><inout_port name="pose" type="Pose" default="{p}"/>
<output_port name="error"/></Action>
<Condition ID="Ready"><input_port name="pose" type="Point" default="{r}"/></Condition>
<SubTree ID="Typed"><input_port name="in"/><output_port name="out" default="{o}"/></SubTree>"""
TYPED = '<BehaviorTree ID="Typed"><AlwaysSuccess/></BehaviorTree>'


def finding_texts(body: str) -> list[str]:
    """Return the findings of a tree Main: name, message and help."""
    problems = findings(document(body, MOVE, TYPED))
    return [f"{problem.rule.name}: {problem.message} | {problem.help}" for problem in problems]


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ("<Sequenc><Move goal='1'/></Sequenc>", "unknown-tree-node: unknown node 'Sequenc' | did you mean 'Sequence'?"),
        (
            "<Qwertz/>",
            "undeclared-tree-node: the node 'Qwertz' is not declared, so its ports are not checked"
            ' | add <Action ID="Qwertz"> with its ports to <TreeNodesModel>, or use --models FILE',
        ),
        (
            "<Moove goal='1'/>",
            "undeclared-tree-node: the node 'Moove' is not declared, so its ports are not checked"
            " | did you mean 'Move'?",
        ),
        ("<Qwertz><Qwertz/></Qwertz>", "undeclared-tree-node: the node 'Qwertz' is not declared, so its ports are not"),
        ("<Typed/>", "unknown-tree-node: unknown node 'Typed' | write <SubTree ID=\"Typed\"/>"),
        ("<Control ID='Own'/>", "wrong-children: 'Own' has no children, not 1 or more | add or remove nodes below it"),
        (
            "<Decorator ID='Own'><AlwaysSuccess/><AlwaysSuccess/></Decorator>",
            "wrong-children: 'Own' has 2 children, not 1 | put them below one node, e.g. <Sequence>",
        ),
        ("<Sequence/>", "wrong-children: 'Sequence' has no children, not 1 or more | add or remove nodes below it"),
        (
            "<Inverter><AlwaysSuccess/><AlwaysFailure/></Inverter>",
            "wrong-children: 'Inverter' has 2 children, not 1 | put them below one node, e.g. <Sequence>",
        ),
        ("<IfThenElse><AlwaysSuccess/></IfThenElse>", "wrong-children: 'IfThenElse' has 1 child, not 2 to 3"),
        (
            '<Switch2 variable="{a}" case_1="1" case_2="2"><AlwaysSuccess/><AlwaysFailure/></Switch2>',
            "wrong-children: 'Switch2' has 2 children, not 3",
        ),
        (
            "<Move goal='1'><AlwaysSuccess/></Move>",
            "wrong-children: 'Move' has 1 child, not 0 | close the element at once: <.../>",
        ),
        (
            "<Move/>",
            "port-without-value: 'Move' has no value for 'goal'"
            ' | write goal="...", or add default="..." to the port in <TreeNodesModel>',
        ),
        ("<Move goal='1' gaol='2'/>", "unknown-port: 'Move' has no port 'gaol' | did you mean 'goal'?"),
        ("<Move goal='1' speed='2'/>", "undeclared-port: 'Move' has no port 'speed' | its ports are goal, pose, error"),
        ("<Sleep msec='1' speed='2'/>", "unknown-port: 'Sleep' has no port 'speed' | its ports are msec"),
        ("<Move goal='far'/>", "port-value: 'goal' is 'far', not a value of the type double | write one, or an entry"),
        (
            "<Move goal='{}'/>",
            "port-value: 'goal' is '{}', not a text or an entry | write {name}: letters, digits and _",
        ),
        ("<Move goal='{a'/>", "port-value: 'goal' is '{a', not a value of the type double"),
        (
            "<Move goal='1' error='e'/>",
            "port-value: 'error' is 'e', not an entry, since the node writes it | write {e}",
        ),
        ("<Sleep/>", "missing-port: 'Sleep' needs its port 'msec'"),
        ("<Sleep msec='-1'/>", "port-value: 'msec' is '-1', not a whole number of milliseconds, at least 0"),
        ("<Sleep msec='1.5'/>", "port-value: 'msec' is '1.5', not a whole number of milliseconds, at least 0"),
        (
            "<Repeat num_cycles='x'><AlwaysSuccess/></Repeat>",
            "port-value: 'num_cycles' is 'x', not a whole number | correct it",
        ),
        (
            "<Parallel success_count='2'><AlwaysSuccess/></Parallel>",
            "port-value: 'success_count' is '2', not at most 1, the number of children | correct it",
        ),
        (
            "<Precondition if='true' else='MAYBE'><AlwaysSuccess/></Precondition>",
            "port-value: 'else' is 'MAYBE', not SUCCESS, FAILURE, SKIPPED or RUNNING",
        ),
        (
            "<SetBlackboard value='1' output_key='{k}'/>",
            "port-value: 'output_key' is '{k}', not the name of an entry, without braces | write k",
        ),
        ("<SubTree ID='Typd'/>", "unknown-subtree: there is no tree 'Typd' | did you mean 'Typed'?"),
        ("<SubTree ID='Typed'/>", "missing-port: 'SubTree' needs its port 'in'"),
        ("<SubTree ID='Typed' in='1' on='2'/>", "unused-remap: the tree 'Typed' has no port 'on' | did you mean"),
        ("<SubTree ID='Typed' in='1' out='2'/>", "port-value: 'out' is '2', not an entry, since the node writes it"),
        ("<SubTree ID='Typed' in='1' _autoremap='yes'/>", "port-value: '_autoremap' is 'yes', not true or false"),
        ("<SubTree ID='Main'/>", "subtree-recursion: subtrees form a cycle: Main -> Main | a tree cannot contain"),
        ("<AlwaysSuccess _skipif='true'/>", "unknown-port: unknown condition '_skipif' | did you mean '_skipIf'?"),
        (
            "<AlwaysSuccess _mark='1'/>",
            "attribute-without-effect: '_mark' has no effect"
            " | remove it; codra does not remove it when it writes the file",
        ),
        ("<AlwaysSuccess/>text", "xml-not-kept: the text 'text' has no meaning in a tree | remove it, or make it"),
        ("<?php x?><AlwaysSuccess/>", "xml-not-kept: <?php ...?> has no meaning in a tree | remove it"),
        (
            "<AlwaysSuccess/><AlwaysFailure/>",
            "wrong-children: a tree has one root, but this one has 2 nodes | put them",
        ),
        ("<Action/>", "missing-attribute: <Action> has no 'ID' | write <Action ID=\"...\">"),
        (
            "<Sequence><Move goal='1' pose='{p}'/><Ready pose='{p}'/></Sequence>",
            "entry-types-differ: the entry 'p' is Point here, and Pose elsewhere | use two entries",
        ),
    ],
)
def test_a_mistake_is_reported_with_help(body: str, expected: str) -> None:
    (problem, *_) = finding_texts(body)

    assert problem.startswith(expected)


@pytest.mark.parametrize("node", sorted(REFUSED_NODES))
def test_the_help_for_a_refused_node_names_a_replacement(node: str) -> None:
    (finding,) = findings(document(f"<Sequence><{node}/></Sequence>"))

    assert finding.message == f"'{node}' is not supported"
    assert finding.help == REFUSED_NODES[node]
    assert (finding.place.span.line, finding.place.span.column) == (
        1,
        document("").index("</Beh") + len("<Sequence>") + 1,
    )


def test_supported_and_refused_nodes_are_disjoint() -> None:
    assert not set(BUILT_IN) & set(REFUSED_NODES)


def test_all_mistakes_of_a_file_are_reported_at_once_with_their_places() -> None:
    text = """<root BTCPP_format="4">
  <BehaviorTree ID="A">
    <Sequence>
      <Sleep msec="soon"/>
      <Sleeep msec="1"/>
      <Sleep
         mesc="1"/>
      <Script code="x := (1"/>
      <SubTree ID="B"/>
    </Sequence>
  </BehaviorTree>
  <BehaviorTree ID="A"><Sequence/></BehaviorTree>
  <TreeNodeModel/>
</root>"""

    assert sorted(places_and_rules(text)) == sorted(
        [
            "13:3 misplaced-element",
            "12:21 duplicate-tree",
            "12:24 wrong-children",
            "4:20 port-value",
            "5:7 unknown-tree-node",
            "7:10 unknown-port",
            "8:27 script-syntax",
            "9:7 unknown-subtree",
        ]
    )


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('<root BTCPP_format="5"/>', "no-tree-file: the format '5' is not a version of BehaviorTree.CPP"),
        ('<tree BTCPP_format="4"/>', "no-tree-file: this is not a file of BehaviorTree.CPP: <tree>"),
        ("<robot/>", "no-tree-file: this is not a file of BehaviorTree.CPP: <robot>"),
        ('<root BTCPP_format="4"/>', "no-tree-file: the file has no trees"),
        ('<root BTCPP_format="4" main_tree_to_execute="M"/>', "no-tree-file: the file has no trees"),
        (
            '<root BTCPP_format="4"><TreeNodesModel><Control ID="X"/></TreeNodesModel></root>',
            "no-tree-file: the file has no trees",
        ),
        ("", "xml-syntax: invalid XML: no element found"),
        ("<root>", "xml-syntax: invalid XML: no element found"),
        ("<root></tree>", "xml-syntax: invalid XML: mismatched tag"),
        ('<root a="1" a="2"/>', "xml-syntax: invalid XML: duplicate attribute"),
        ("<root a='&nbsp;'/>", "xml-syntax: invalid XML: undefined entity"),
    ],
)
def test_a_file_without_trees_is_reported(text: str, expected: str) -> None:
    finding = findings(text)[0]

    assert f"{finding.rule.name}: {finding.message}" == expected
    assert finding.help


def test_a_file_without_version_and_id_is_read_with_warnings_that_say_how() -> None:
    tree = "<BehaviorTree><AlwaysSuccess/></BehaviorTree>"

    assert [
        (problem.rule.name, problem.severity, problem.place.span.column) for problem in findings(f"<root>{tree}</root>")
    ] == [
        ("tree-format", "warning", 1),
        ("tree-without-id", "warning", len("<root>") + 1),
    ]


def test_trees_without_id_beside_others_are_errors_and_give_no_other_finding() -> None:
    tree = "<BehaviorTree><AlwaysSuccess/></BehaviorTree>"

    problems = findings(f'<root BTCPP_format="4">{tree * 2}</root>')
    assert [problem.rule.name for problem in problems] == ["missing-attribute"] * 2


def test_a_remapped_entry_that_the_subtree_never_uses_is_reported() -> None:
    others = '<BehaviorTree ID="Go"><Script code="goal := 1" _skipIf="ready" _post="done := 2"/></BehaviorTree>'
    body = '<SubTree ID="Go" gaol="{g}" ready="{r}" done="{d}"/>'
    (finding,) = findings(document(body, "", others))

    assert (finding.rule.name, finding.severity) == ("unused-remap", "warning")
    assert finding.help == "did you mean 'goal'?"


@pytest.mark.parametrize(("name", "models"), [("Sequence", ""), ("MoveTo", '<Action ID="MoveTo"/>')])
def test_a_tree_cannot_have_the_name_of_a_node(name: str, models: str) -> None:
    others = f'<BehaviorTree ID="{name}"><AlwaysSuccess/></BehaviorTree>'
    (finding,) = findings(document(f'<SubTree ID="{name}"/>', models, others))

    assert (finding.rule.name, finding.message) == ("duplicate-tree", f"the tree '{name}' has the name of a node")


def test_names_that_newer_versions_of_the_library_refuse_are_reported() -> None:
    others = '<BehaviorTree ID="give up"><AlwaysSuccess name="any thing: 1.5"/></BehaviorTree>'
    models = '<Action ID="Move.To"><input_port name="to/from"/><input_port name="T\u00fcr-1_a"/></Action>'

    problems = findings(document("<AlwaysSuccess/>", models, others))
    assert {problem.rule.name for problem in problems} == {"library-refuses-name"}
    assert [problem.message[:3] for problem in problems] == ["' '", "'.'", "'/'"]


@pytest.mark.parametrize("name", ["Root", "root"])
def test_the_reserved_name_of_the_library_is_reported_for_trees_and_nodes(name: str) -> None:
    tree = f'<BehaviorTree ID="{name}"><AlwaysSuccess/></BehaviorTree>'
    node = f'<Action ID="{name}"/>'

    for text in (document("<AlwaysSuccess/>", "", tree), document("<AlwaysSuccess/>", node)):
        (finding,) = findings(text)
        assert (finding.rule.name, finding.rule.severity) == ("library-refuses-name", Severity.WARNING)
        assert finding.message.startswith(f"the name '{name}' is reserved")
        assert finding.place.span.column == text.index(f'"{name}"') + 2
    assert findings(document("<AlwaysSuccess/>", '<Action ID="ROOT"/>', tree.replace(name, "Roots"))) == []


def test_subtrees_of_one_tree_with_one_name_are_reported_at_the_second() -> None:
    others = '<BehaviorTree ID="Other"><AlwaysSuccess/></BehaviorTree>'
    twin = '<SubTree ID="Other" name="twin"/>'
    text = document(f"<Sequence>{twin}<Inverter>{twin}</Inverter></Sequence>", "", others)

    (finding,) = findings(text)
    assert (finding.rule.name, finding.place.span.column) == ("library-refuses-name", text.rindex(twin) + 1)
    assert [related.place.span.column for related in finding.related] == [text.index(twin) + 1]

    unnamed = '<SubTree ID="Other"/>'
    third = f'<BehaviorTree ID="Third">{twin}</BehaviorTree>'
    assert findings(document(f"<Sequence>{twin}{unnamed}{unnamed}</Sequence>", "", others + third)) == []


def test_a_reactive_sequence_has_at_most_one_asynchronous_child_for_the_library() -> None:
    children = "<AsyncSequence><AlwaysSuccess/></AsyncSequence>"
    text = document(f"<ReactiveSequence>{children * 2}</ReactiveSequence>", "")

    (finding,) = findings(text)
    assert (finding.rule.name, finding.rule.severity) == ("library-refuses-children", Severity.WARNING)
    assert finding.place.span.column == text.index("<ReactiveSequence") + 1
    assert findings(document(f"<ReactiveSequence>{children}<AlwaysSuccess/></ReactiveSequence>", "")) == []
    assert findings(document(f"<ReactiveFallback>{children * 2}</ReactiveFallback>", "")) == []


def test_a_forest_without_files_is_refused() -> None:
    with pytest.raises(ValueError, match="a forest has at least one file"):
        Forest(files=())


def test_columns_count_letters_not_bytes() -> None:
    line = document("<Sequence name='\u00e4\u2603\U0001f916'><Sleep msec='soon'/></Sequence>")

    assert places_and_rules(line) == [f"1:{line.index('soon') + 1} port-value"]


# Hostile files

BOMB = '<!DOCTYPE l [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;">]><root n="&c;"/>'
OUTSIDE = '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><root BTCPP_format="4">&x;</root>'


@pytest.mark.parametrize(
    ("data", "rule"),
    [
        (BOMB.encode(), "xml-doctype"),
        (OUTSIDE.encode(), "xml-doctype"),
        (b'<!DOCTYPE r SYSTEM "http://localhost/x.dtd"><root/>', "xml-doctype"),
        (b"<a>" * (MAX_DEPTH + 1), "tree-too-deep"),
        (b"<a>" * 200_000, "tree-too-deep"),
        (b"<a>" + b"<b/>" * MAX_ELEMENTS + b"</a>", "too-many-tree-nodes"),
        (b"<a>" + b"<?b?>" * 2 * MAX_ELEMENTS + b"</a>", "too-many-tree-nodes"),
        (b"<a>" + b"text<!---->" * 2 * MAX_ELEMENTS + b"</a>", "too-many-tree-nodes"),
        (b"<a " + b" ".join(b'x%d="1"' % number for number in range(100)) + b"/>", "too-many-tree-nodes"),
        (b"<a x='" + b"y" * 5000 + b"'/>", "tree-file-too-large"),
        (b"<a>" + b" " * MAX_BYTES + b"</a>", "tree-file-too-large"),
        ("<root/>".encode("utf-16"), "not-utf-8"),
        (b'<?xml version="1.0" encoding="UTF-16"?><root/>', "xml-encoding"),
        (b'<?xml version="1.0" encoding="latin-1"?><root a="\xe4"/>', "not-utf-8"),
        (b"\x00<root/>", "control-character"),
        (b"<root a='\xed\xa0\x80'/>", "not-utf-8"),
        (b"<root>&#0;</root>", "xml-syntax"),
        (b"<root", "xml-syntax"),
    ],
)
def test_a_hostile_file_is_refused(data: bytes, rule: str) -> None:
    file, problems = read_text(data, "hostile.xml")

    assert file is None
    assert problems[-1].rule.name == rule


def test_a_tree_that_grows_exponentially_by_its_subtrees_is_refused() -> None:
    trees = "".join(
        f'<BehaviorTree ID="T{n}"><Sequence><SubTree ID="T{n + 1}"/><SubTree ID="T{n + 1}"/></Sequence></BehaviorTree>'
        for n in range(60)
    )
    last = '<BehaviorTree ID="T60"><AlwaysSuccess/></BehaviorTree>'

    assert [line.split()[1] for line in places_and_rules(document("<SubTree ID='T0'/>", "", trees + last))] == [
        "too-many-tree-nodes"
    ]


def test_a_recursion_is_reported_with_its_complete_cycle() -> None:
    others = "".join(f'<BehaviorTree ID="{a}"><SubTree ID="{b}"/></BehaviorTree>' for a, b in ("AB", "BC", "CA"))
    (finding,) = findings(document("<SubTree ID='A'/>", "", others))

    assert finding.message == "subtrees form a cycle: A -> B -> C -> A"


@given(st.binary(max_size=300) | st.text(alphabet="<>/='\" rotABCSequencéID&#;!-[]", max_size=200).map(str.encode))
def test_any_bytes_are_read_or_refused(data: bytes) -> None:
    file, problems = read_text(data, "any.xml")

    assert file is not None or problems


# Includes

PART = '<root BTCPP_format="4"><BehaviorTree ID="Part"><AlwaysSuccess/></BehaviorTree>{}</root>'
MAIN_FILE = '<root BTCPP_format="4">{}<BehaviorTree ID="Main"><SubTree ID="Part"/></BehaviorTree></root>'


def test_included_files_anywhere_in_the_project_are_read_once(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "part.xml").write_text(PART.format('<include path="../main.xml"/>'))
    (tmp_path / "main.xml").write_text(MAIN_FILE.format('<include path="parts/part.xml"/>' * 2))

    forest, problems = read(tmp_path / "main.xml", tmp_path)
    assert problems == ()
    assert forest is not None
    assert [file.file for file in forest.files] == ["main.xml", "parts/part.xml"]
    assert check(forest)[1] == ()
    assert forest.main == "Main"


@pytest.mark.parametrize(
    ("include", "message"),
    [
        ('<include path="../outside.xml"/>', "'../outside.xml' is outside of the project"),
        ('<include path="/etc/passwd"/>', "'/etc/passwd' is outside of the project"),
        ('<include path="link.xml"/>', "'link.xml' is outside of the project"),
        ('<include path="none.xml"/>', "there is no file 'none.xml'"),
        ('<include path="."/>', "there is no file '.'"),
        (f'<include path="{"n" * 3000}"/>', f"there is no file '{'n' * 3000}'"),
        ('<include ros_pkg="p" path="part.xml"/>', "packages of ROS are not searched"),
    ],
)
def test_a_forbidden_include_is_reported_at_its_place(tmp_path: Path, include: str, message: str) -> None:
    project = tmp_path / "project"
    project.mkdir()
    (tmp_path / "outside.xml").write_text(PART.format(""))
    (project / "link.xml").symlink_to(tmp_path / "outside.xml")
    (project / "main.xml").write_text(MAIN_FILE.format(include))

    _, problems = read(project / "main.xml", project)
    assert [(problem.rule.name, problem.message) for problem in problems] == [("tree-include", message)]
    assert problems[0].place.span.line == 1


# Settings

SPEC = """\
codra: 1
name: truck
trees:
  mission: {file: main.xml, leaves: {}}
loops:
  driving: {execute: [mission]}
"""


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ("", [("CDR3309", "warning")]),
        ('ignore = ["CDR3309"]', []),
        ('select = ["CDR5"]', []),
        ('severity = {CDR33 = "error"}', [("CDR3309", "error")]),
    ],
)
def test_settings_select_findings_of_trees_and_set_their_severity(
    tmp_path: Path, settings: str, expected: list[tuple[str, str]]
) -> None:
    (tmp_path / "pyproject.toml").write_text(f"[tool.codra.lint]\n{settings}\n")
    (tmp_path / "main.xml").write_text(document('<AlwaysSuccess _mark="1"/>'))
    (tmp_path / "spec.yaml").write_text(SPEC)

    problems = plan_paths([tmp_path / "spec.yaml"], tmp_path).diagnostics

    assert [(problem.code, problem.severity) for problem in problems] == expected


MARKED = '<AlwaysSuccess _mark="1"/>'


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        (f"\n{MARKED} <!-- codra: ignore[CDR3309] the editor needs it -->\n", []),
        (f"\n<!-- codra: ignore[CDR3309] the editor needs it -->\n<!-- more -->\n{MARKED}\n", []),
        (f"<!-- codra: ignore[CDR3309] the editor needs it -->{MARKED}", []),
        (
            f"\n{MARKED} <!-- codra: ignore[CDR3309] -->\n",
            [(2, "CDR7902", "the comment does not state why it silences")],
        ),
        (
            f"\n<!-- codra: ignore[CDR3309] why -->\n<Inverter>\n{MARKED}</Inverter>",
            [(2, "CDR7901", "'CDR3309' silences nothing: "), (4, "CDR3309", "'_mark' has no effect")],
        ),
        ("\n<AlwaysSuccess/> <!-- codra: ignore[CDR3309] why -->\n", [(2, "CDR7901", "'CDR3309' silences nothing: ")]),
        (
            "\n<AlwaysSuccess/> <!-- codra: ignore[CDR2303] why -->\n",
            [(2, "CDR7904", "'CDR2303' is an error that prevents")],
        ),
        (
            f"\n<![CDATA[<!-- codra: ignore[CDR3309] why -->]]>{MARKED}",
            [(2, "CDR1304", "the text"), (2, "CDR3309", "'_")],
        ),
        ("\n<AlwaysSuccess/> <!-- codra: ignore CDR3309 -->\n", [(2, "CDR7905", "this comment silences nothing")]),
    ],
)
def test_comments_in_a_file_of_trees_silence_its_findings(
    tmp_path: Path, body: str, expected: list[tuple[int, str, str]]
) -> None:
    (tmp_path / "main.xml").write_text(document(body))
    (tmp_path / "spec.yaml").write_text(SPEC)

    problems = plan_paths([tmp_path], tmp_path).diagnostics

    assert [(problem.place.span.line, problem.code) for problem in problems] == [
        (line, code) for line, code, _ in expected
    ]
    assert all(problem.message.startswith(message) for problem, (_, _, message) in zip(problems, expected, strict=True))
    assert all(problem.fix is None for problem in problems)


def test_invalid_xml_is_a_finding_of_the_spec_that_names_the_file(tmp_path: Path) -> None:
    (tmp_path / "main.xml").write_text("<root")
    (tmp_path / "spec.yaml").write_text(SPEC)

    (finding,) = plan_paths([tmp_path / "spec.yaml"], tmp_path).diagnostics

    assert (finding.code, finding.place.span.file, finding.place.span.line) == ("CDR1301", "main.xml", 1)


def test_codes_of_rules_are_unique() -> None:
    assert len({rule.code for rule in RULES.values()}) == len(RULES)
