"""Hostile behavior trees in the XML of BehaviorTree.CPP: random trees and those of this repository, with damage."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from random import Random

from codra_dsl.generation.emit.behaviour_trees import tree_module
from codra_dsl.language.behavior_trees import check, read, read_text, write
from codra_dsl.language.behavior_trees.folders import check_files
from codra_dsl.tooling.report.tree_pictures import picture_of
from tests.campaigns.hostile.damage import damaged_bytes, encoded
from tests.campaigns.hostile.reading import Answer, Files, Kind, Link
from tests.campaigns.hostile.texts import NUMBERS, ODD_NAMES, RESERVED_NAMES, TEXTS
from tests.campaigns.hostile.xml_damage import damaged_xml
from tests.language.behavior_trees.random_trees import RandomTree
from tests.language.behavior_trees.real_texts import NAV2_BODIES, nav2_file
from tests.language.behavior_trees.real_texts import TEXTS as REAL_TEXTS
from tests.language.behavior_trees.stories import document

ROOT = Path(__file__).parents[3]
_FILES = tuple(path.read_text("utf-8") for path in sorted((ROOT / "specs/trees").glob("*.xml")))
_PAGE_TREES = (
    document('<Sequence><A/><SubTree ID="Main"/></Sequence>'),
    document('<SubTree ID="B"/>', others='<BehaviorTree ID="B"><SubTree ID="Main"/></BehaviorTree>'),
)
"""Trees that contain themselves."""

SCRIPTS = (
    *("x := x", "x := 1 / 0", "x := 9 ** 9", "x += x; " * 300, "(" * 300 + "1", "!" * 300 + "x", "x ? y", "x ? y : z"),
    *("__import__('os').system('touch owned')", "x := 'a", "'a' + 1", "x ==== y", "true := 1", "x := {}", "x.y := 1"),
    *("x := 1e999", "x := 99999999999999999999999", "x := 0xFFFFFFFFFFFFFFFFF", "-" * 300 + "1", "a && b || c", ";;;"),
)


def _random_tree(chance: Random) -> str:
    return RandomTree(chance, chance.choice((1, 2, 3, 4))).text


def _named(chance: Random) -> str:
    """Return a tree in which nodes, trees, ports and entries have odd names, consistently."""
    name = chance.choice((*RESERVED_NAMES, *ODD_NAMES[:50]))
    text = _random_tree(chance)
    old_name = chance.choice(("Main", "Sub0", "A", "x", "t", "Sequence"))
    return (
        text.replace(f'"{old_name}"', f'"{name}"')
        .replace(f"<{old_name} ", f"<{name} ")
        .replace(f"{{{old_name}}}", f"{{{name}}}")
    )


def _real(chance: Random) -> str:
    """Return a text of the field: of version 3, with values that are not escaped, or with nodes of the robot."""
    texts = [text for text, _ in REAL_TEXTS.values()] + [nav2_file(body) for body in NAV2_BODIES.values()]
    text = chance.choice(texts)
    return text.replace('"4"', chance.choice(('"4"', '"3"', '"5"', '""')), chance.random() < 0.3)


def _scripted(chance: Random) -> str:
    script = chance.choice((*SCRIPTS, *TEXTS, *(f"x := {number}" for number in NUMBERS))).replace("&", "&amp;")
    script = script.replace("<", "&lt;").replace('"', "&quot;")
    tag = chance.choice(("Script", "ScriptCondition", "Precondition"))
    attribute = "if" if tag == "Precondition" else "code"
    condition = chance.choice(("_skipIf", "_failureIf", "_while", "_onSuccess", "_post", "_onHalted", "_x"))
    inner = f'<A {condition}="{script}"/>'
    return document(
        f'<Sequence><{tag} {attribute}="{script}">{inner if tag == "Precondition" else ""}</{tag}>{inner}</Sequence>'
    )


def _large(chance: Random) -> str:
    """Return a tree that is too deep, too wide, or that grows with its subtrees."""
    many = chance.choice((60, 300, 9000))
    trees = "".join(
        f'<BehaviorTree ID="T{number}"><Sequence>'
        + f'<SubTree ID="T{number + 1}"/>' * 10
        + "</Sequence></BehaviorTree>"
        for number in range(chance.choice((3, 30)))
    )
    return chance.choice(
        (
            document("<Inverter>" * many + "<A/>" + "</Inverter>" * many),
            document("<Sequence>" + "<A/>" * many + "</Sequence>"),
            document("<SubTree ID='T0'/>", others=trees),
            document(
                "<Sequence>" + "".join(f'<SubTree ID="Main{n}"/>' for n in range(min(many, 3000))) + "</Sequence>"
            ),
            document("<A/>", models="".join(f'<Action ID="N{n}"/>' for n in range(many))),
            document("<A/>" + "<!-- c -->" * many),
        )
    )


def _make(chance: Random) -> Files:
    makers: tuple[Callable[[Random], str], ...] = (_random_tree, _real, _named, _scripted, _large)
    maker = chance.choices(makers, (40, 20, 15, 10, 3))[0]
    text = chance.choice((*_FILES, *_PAGE_TREES)) if chance.random() < 0.25 else maker(chance)
    is_damaged = chance.random() < 0.75
    data = damaged_xml(chance, text) if is_damaged else encoded(chance, text)
    data = damaged_bytes(chance, data) if chance.random() < 0.05 else data
    return {"tree.xml": data, **(_included(chance) if chance.random() < 0.1 else {})}


def _included(chance: Random) -> Files:
    """Return files that include each other, themselves, or files outside of the project."""
    targets = (
        "tree.xml",
        "a.xml",
        "../x.xml",
        "/etc/passwd",
        ".",
        "",
        "missing.xml",
        "link.xml",
        "a\x01b",
        "b" * 5000,
        "~",
    )
    includes = "".join(f'<include path="{chance.choice(targets)}"/>' for _ in range(chance.choice((1, 2, 150))))
    text = f'<root BTCPP_format="4">{includes}<BehaviorTree ID="Main"><AlwaysSuccess/></BehaviorTree></root>'
    inner = f'<root BTCPP_format="4">{includes}</root>'
    return {
        "tree.xml": text.encode(),
        "a.xml": inner.encode(),
        "link.xml": Link(chance.choice(("/dev/zero", "link.xml", "a.xml", "/etc/passwd", "."))),
    }


def _read(root: Path) -> Answer:
    """Read and check a file with its included files and with its folder; write, read again, draw and compile it."""
    forest, read_findings = read(root / "tree.xml", root)
    checked, findings = (None, ()) if forest is None else check(forest)
    codes = tuple(finding.code for finding in (*read_findings, *findings))
    for file in () if forest is None else forest.files:
        again, _ = read_text(write(file).encode("utf-8", "surrogatepass"), file.file)
        assert again is not None, "the tree cannot be read after it has been written"
        assert write(again) == write(file), "the tree differs after writing and reading"
    check_files([root], [], root)
    if forest is not None:
        picture = picture_of([forest])
        assert picture.dot()
        assert picture.mermaid()
    if checked is None:
        assert codes, "the tree is refused without a finding"
        return Answer(False, codes)
    compile(tree_module(checked), "tree.py", "exec", dont_inherit=True)
    return Answer(True, codes)


TREES = Kind(_make, _read)
