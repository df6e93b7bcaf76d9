"""Decisions in Python: branches on the results of calls, and nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from codra_dsl.tooling.main_execution.model import Decision, SourceError
from codra_dsl.tooling.main_execution.python_source import read_python


def decisions_in(folder: Path, text: str) -> tuple[Decision, ...]:
    file = folder / "robot.py"
    file.write_text(text, "utf-8")
    return read_python(file, folder, folder).decisions


def names_in(folder: Path, text: str) -> list[str]:
    return list(dict.fromkeys(decision.name for decision in decisions_in(folder, text)))


@pytest.mark.parametrize(
    "text",
    [
        "if robot.is_near(): pass",
        "while not robot.is_near(): pass",
        "assert robot.is_near(), 'far'",
        "x = 1 if robot.is_near() else 2",
        "match robot.is_near():\n case True: pass",
        "x = [a for a in b if robot.is_near()]",
        "if a and (b or not robot.is_near()): pass",
        "near = robot.is_near()\nif near: pass",
        "if near := robot.is_near(): pass",
        "near, far = robot.is_near(), 1\nif near: pass",
        "self.near = robot.is_near()\nif self.near: pass",
        "if bool(robot.is_near()): pass",
        "if robot.is_near().strip().lower() == 'yes': pass",
        "if robot.is_near()[0].value > 1: pass",
        "for near in robot.is_near():\n if near: pass",
        "with robot.is_near() as near:\n if near: pass",
        "try:\n pass\nexcept ValueError:\n if robot.is_near(): pass",
        "async def f():\n if await robot.is_near(): pass",
        "def f():\n def g():\n  if robot.is_near(): pass",
        "class A:\n def f(self):\n  if robot.is_near(): pass",
        "def near():\n return robot.is_near()\nif near(): pass",
        "def go(near):\n if near: pass\ngo(robot.is_near())",
        "if True:\n def f():\n  if robot.is_near(): pass",
        "near = robot.is_near()\nif slow:\n near = None\nif near: pass",
        "if slow:\n near = robot.is_near()\nelse:\n near = None\nif near: pass",
        "try:\n near = robot.is_near()\nexcept OSError:\n near = None\nif near: pass",
        "match speed:\n case 1: near = robot.is_near()\n case _: near = None\nif near: pass",
        "near = None\nwhile not near:\n near = robot.is_near()",
        "near = None\nfor speed in speeds:\n if near: pass\n near = robot.is_near()",
        "near = robot.is_near()\nwhile slow:\n near = None\nif near: pass",
        "near = robot.is_near()\nnear += 1\nif near > 3: pass",
        "class A:\n def f(self):\n  if self.near.x > 1: pass\n def g(self):\n  self.near = robot.is_near()",
        "class A:\n def f(self):\n  self.near = robot.is_near()\nclass B(A):\n def g(self):\n  if self.near: pass",
        "class A:\n def f(self):\n  if robot.is_near(): pass\nclass B(A):\n def g(self):\n  if self.f(): pass",
        "def f():\n ok = robot.is_near()\n if not ok: pass\n return ok\nf()",
        "class A:\n @property\n def f(self):\n  if robot.is_near(): pass\n @f.setter\n def f(self, value): pass",
        "def f():\n def h():\n  if robot.is_near(): pass\ndef g():\n def h(): pass",
    ],
)
def test_a_branch_on_the_result_of_a_call_is_a_decision(text: str, tmp_path: Path) -> None:
    assert names_in(tmp_path, text) == ["robot_is_near"]


@pytest.mark.parametrize(
    "text",
    [
        "robot.is_near()",
        "if near: pass",
        "if robot.near: pass",
        "if len(items) > 3 and isinstance(items, list): pass",
        "if name.startswith('a'): pass",
        "import os, math\nif os.path.exists(a) or math.isclose(b, c): pass",
        "for near in robot.is_near(): robot.go()",
        "if Pose(1, 2) == goal: pass",
        "f = lambda: 1 if robot.is_near() else 2",
        "import rclpy\nwhile rclpy.ok(): pass",
        "import os.path\nif os.path.exists(a): pass",
        "try:\n import numpy\nexcept ImportError:\n numpy = None\nif numpy.isclose(a, b): pass",
        "near = robot.is_near()\nnear = 3\nif near: pass",
        "if settings.get('verbose'): pass",
    ],
)
def test_other_calls_and_branches_are_no_decisions(text: str, tmp_path: Path) -> None:
    assert names_in(tmp_path, text) == []


def test_a_function_that_perceives_is_one_decision_and_others_are_followed(tmp_path: Path) -> None:
    text = """\
def is_open(door):
    if camera.capture() is None:
        return None
    return True

def localize():
    if robot.is_lost():
        robot.turn()

def enter(door):
    localize()
    if is_open(door):
        return robot.push()
    return False

if enter("front"):
    enter("back")
"""
    assert names_in(tmp_path, text) == ["robot_is_lost", "is_open_front", "is_open_back", "robot_push"]


def test_texts_are_followed_through_calls_defaults_tables_and_loops(tmp_path: Path) -> None:
    text = """\
DOORS = {Side.IN: "entrance", "out": "exit"}

def check_all(*doors, prefix="door"):
    for door in doors:
        if sees(f"{prefix}_{door}"): pass

def ask(door):
    check_all(door, DOORS["out"], *("a", "b"))

ask(DOORS[Side.IN])
check_all("c", prefix="gate")
"""
    expected = {"sees_door_entrance", "sees_door_exit", "sees_door_a", "sees_door_b", "sees_gate_c"}
    assert set(names_in(tmp_path, text)) == expected


def test_a_function_without_known_caller_is_one_decision_named_after_its_parameter(tmp_path: Path) -> None:
    assert names_in(tmp_path, "def go(door):\n if sees(f'{door}_open'): pass") == ["sees_door_open"]


def test_a_static_method_gets_its_arguments_without_an_object(tmp_path: Path) -> None:
    text = """\
class Robot:
    @staticmethod
    def _pass(door):
        if sees(door): pass
    def enter(self):
        self._pass("front")
"""
    assert names_in(tmp_path, text) == ["sees_front"]


def test_a_method_of_a_base_class_calls_the_methods_of_the_class_that_uses_it(tmp_path: Path) -> None:
    text = """\
class Task:
    def run(self):
        if self._found(): pass
class Fetch(Task):
    def start(self):
        self.run()
    def _found(self):
        return sees("cup")
"""
    assert names_in(tmp_path, text) == ["sees_cup"]


def test_a_text_that_depends_on_a_branch_is_not_known(tmp_path: Path) -> None:
    text = "if slow:\n door = 'in'\nelse:\n door = 'out'\nif sees(door): pass"

    assert names_in(tmp_path, text) == ["sees_door"]


def test_texts_that_are_passed_by_keyword_distinguish_variables(tmp_path: Path) -> None:
    text = "if sees(what='cup', timeout=3) or sees(what='plate'): pass\ndef go(it):\n if sees(what=it): pass\ngo('jug')"

    assert names_in(tmp_path, text) == ["sees_cup", "sees_plate", "sees_jug"]


def test_a_module_of_the_project_may_have_the_name_of_a_library(tmp_path: Path) -> None:
    assert names_in(tmp_path, "from .signal import is_red\nif is_red(): pass") == ["is_red"]


def test_results_that_are_passed_on_many_times_are_examined_in_time_linear_in_their_number(tmp_path: Path) -> None:
    refinements = "pose = refine(pose, pose)\n" * 2_000

    assert names_in(tmp_path, f"pose = robot.see()\n{refinements}if pose: pass") == ["refine_refine_refine"]


def test_global_names_that_are_bound_after_a_function_are_known_in_it(tmp_path: Path) -> None:
    text = "def go():\n if sees(DOOR): pass\nif __name__ == '__main__':\n DOOR = 'in'\n go()"

    assert names_in(tmp_path, text) == ["sees_in"]


def test_branches_cost_what_they_bind_and_not_what_is_bound_before(tmp_path: Path) -> None:
    names = "".join(f"name_{number} = {number}\n" for number in range(20_000))

    assert names_in(tmp_path, names + "if name: 0\n" * 20_000 + "if see(): pass") == ["see"]


def test_names_keep_letters_without_their_marks_and_are_unique(tmp_path: Path) -> None:
    text = "if r.ist_tür_offen() or r.ist_tur_offen() or дверь() or окно() or r.lambda_(): pass"

    assert names_in(tmp_path, text) == ["r_ist_tur_offen", "r_ist_tur_offen_2", "decision", "decision_2", "r_lambda"]


def test_a_recursion_ends(tmp_path: Path) -> None:
    assert names_in(tmp_path, "def go(a):\n if sees(a): go(f'{a}x')\ngo('a')") == ["sees_a"]


@pytest.mark.parametrize(
    ("test", "type_"),
    [
        ("see()", "bool"),
        ("see() is None", "bool"),
        ("see() > 1.5", "float"),
        ("see().x == 3", "float"),
        ("see() == 'red'", "str"),
        ("see() in ('red', 'blue')", "str"),
        ("see() == Result.FAILED", "str"),
        ("see() == robot.goal", "bool"),
        ("see() == True", "bool"),
    ],
)
def test_the_type_of_a_variable_follows_from_comparisons(test: str, type_: str, tmp_path: Path) -> None:
    assert [decision.type.value for decision in decisions_in(tmp_path, f"if {test}: pass")] == [type_]


@pytest.mark.parametrize(
    ("pattern", "type_"), [("'red'", "str"), ("Result.FAILED", "str"), ("3 | 4", "float"), ("True", "bool")]
)
def test_the_type_of_a_variable_follows_from_patterns(pattern: str, type_: str, tmp_path: Path) -> None:
    text = f"match see():\n case {pattern}: pass"

    assert [decision.type.value for decision in decisions_in(tmp_path, text)] == [type_]


def test_a_comprehension_over_known_texts_is_one_decision_for_each(tmp_path: Path) -> None:
    text = "DOORS = ('in', 'out')\nif all(sees(door) for door in DOORS): pass\nx = {a: b for a in DOORS if near(a)}"

    assert names_in(tmp_path, text) == ["sees_in", "sees_out", "near_in", "near_out"]


def test_a_loop_holds_its_condition_also_if_its_function_returns_the_result(tmp_path: Path) -> None:
    text = "def _go():\n while not (near := robot.is_near()): pass\n return near\ndef main():\n if _go(): pass"

    decisions = decisions_in(tmp_path, text)
    assert [(decision.name, decision.skill, decision.role.value) for decision in decisions] == [
        ("robot_is_near", "main", "hold"),
        ("robot_is_near", "main", "precondition"),
    ]


def test_a_file_may_declare_its_encoding(tmp_path: Path) -> None:
    (tmp_path / "robot.py").write_bytes("# -*- coding: latin-1 -*-\nif 'é' and see(): pass".encode("latin-1"))

    (decision,) = read_python(tmp_path / "robot.py", tmp_path, tmp_path).decisions

    assert (decision.place.span.line, decision.place.span.column) == (2, 12)


def test_columns_count_characters_in_any_line_ending(tmp_path: Path) -> None:
    (tmp_path / "robot.py").write_bytes("\ufeffif a(): pass\r\nif 'äöü€𝄞' and see(): pass\r\n".encode())

    first, second = read_python(tmp_path / "robot.py", tmp_path, tmp_path).decisions

    assert (first.place.span.line, first.place.span.column) == (1, 4)
    span = second.place.span
    assert (span.file, span.line, span.column, span.end_line, span.end_column) == ("robot.py", 2, 16, 2, 21)


def test_a_module_that_is_imported_is_named_in_the_call(tmp_path: Path) -> None:
    text = "import a.b as c\nfrom d import e\nif c.is_x() and e() and c.y.z() and f(): pass"

    assert [decision.call for decision in decisions_in(tmp_path, text)] == ["a.b:is_x", "d:e", "a.b:y.z", "f"]


def test_too_many_decisions_and_too_many_steps_are_refused(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="more than 1,000 decisions"):
        decisions_in(tmp_path, "".join(f"if see{number}(): pass\n" for number in range(1001)))
    functions = "".join(f"def f{n}(a):\n f{n + 1}(f'{{a}}1'); f{n + 1}(f'{{a}}2')\n" for n in range(19))
    with pytest.raises(SourceError, match="more than 200,000 steps"):
        decisions_in(tmp_path, f"{functions}def f19(a): pass\nf0('')\n")
