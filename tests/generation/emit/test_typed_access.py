"""The errors of mypy in a user's program: names, values and skills of a spec are checked before the robot moves."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from codra_dsl.compiler import compile_paths
from codra_dsl.generation.emit.entry import MAX_ENUMS
from tests.type_checker import run_mypy

ROOT = Path(__file__).parents[3]
PROGRAM = """\
from codra_dsl.runtime import Reading, SimClock, Verification
from codra_dsl.runtime.values.conditions import value
from generated import kitchen


def look_at_kettle() -> kitchen.KettleState | None:
    return "hot"


def look(variable: str) -> object:
    return None


def drive(codra: kitchen.Kitchen) -> None:
    is_open: bool = codra.get("fridge_open").value
    water: Reading[float] = codra.get("kettle_water")
    codra.set("robot_place", "stove")
    codra.set("kettle_water", 1, evidence_s=2.0)
    codra.declare("light_is_on", is_open)
    codra.declare("pot_on_hob")
    state: kitchen.KettleState | None = codra.decide("kettle_state", look_at_kettle, max_age_s=5.0)
    docked: bool = codra.decide("kettle_docked", otherwise=lambda: True, wait_up_to_s=2.0)
    found: bool | None = codra.decide("kettle_docked", otherwise=lambda: None)
    with codra.skill("boil_water") as skill, skill.acting():
        outcome: Verification = skill.verify(look)
    codra.subscribe(["kettle_state", "fridge_open"], lambda reading: print(reading.content))
    if codra.wait_for("hob_power", 2.0) or codra.wait_for(value("hob_power") > 10.0, 2.0):
        print(water, state, docked, found, outcome)
    for name in codra.modelled():
        print(name)


with kitchen.start(clock=SimClock(), resources={}) as codra:
    drive(codra)
"""


def errors_in(program: str, folder: Path) -> list[tuple[str, str]]:
    """Return the line and the code of each error that mypy reports in a program, which may import from a folder."""
    file = folder / "robot_program.py"
    file.write_text(program, "utf-8")
    completed_process = run_mypy("--no-error-summary", str(file))
    assert not completed_process.stderr
    errors = re.findall(r"^\S+:(\d+): error: .*\[([a-z-]+)\]$", completed_process.stdout, re.MULTILINE)
    assert len(errors) == completed_process.stdout.count(" error: ")
    lines = program.splitlines()
    return [(lines[int(number) - 1].strip(), code) for number, code in errors]


def test_a_right_program_has_no_error(tmp_path: Path) -> None:
    assert errors_in(PROGRAM, tmp_path) == []


def test_three_wrong_uses_are_three_errors(tmp_path: Path) -> None:
    wrong = PROGRAM.replace('get("fridge_open")', 'get("fridge_opne")')
    wrong = wrong.replace('"robot_place", "stove"', '"robot_place", "stoove"')
    wrong = wrong.replace('skill("boil_water")', 'skill("boil_whater")')
    assert errors_in(wrong, tmp_path) == [
        ('is_open: bool = codra.get("fridge_opne").value', "call-overload"),
        ('codra.set("robot_place", "stoove")', "call-overload"),
        ('with codra.skill("boil_whater") as skill, skill.acting():', "arg-type"),
    ]


def test_every_other_wrong_use_is_one_error(tmp_path: Path) -> None:
    wrong = [
        'codra.set("kettle_water", "full")',
        'codra.set("fridge_open", 2)',
        'codra.set("kettle", True)',
        'codra.declare("light_is_on", "yes")',
        'codra.declare("lihgt_is_on")',
        'codra.decide("kettle_docked", otherwise=lambda: "there")',
        'text: str = codra.get("kettle_water").value',
        'codra.get("kettle_state").value == "boilling"',
        'codra.expect("boil_water", "cok")',
        'codra.history("kettle")',
        'codra.subscribe("kettle", print)',
        'codra.wait_for("kettle", 1.0)',
        'codra.withdraw("kettle")',
        'codra.agent("wall_switch").set("light", True)',
    ]
    program = PROGRAM + "".join(f"    {line}\n" for line in wrong)
    assert [line for line, _ in errors_in(program, tmp_path)] == wrong


PACKAGES = "compiled"
"""The folder of compiled packages; mypy would take one of the name `generated` for that of this repository."""

LONG = "state_of_the_third_drawer_from_above_in_the_laboratory_on_the_left"


def made(lines: list[str], folder: Path) -> None:
    """Compile a spec with some variables, and assert that ruff would not change the result."""
    (folder / "specs").mkdir()
    (folder / "specs/drawers.yaml").write_text("\n".join(["codra: 1", "name: drawers", "context:", *lines, ""]))
    compilation = compile_paths([folder / "specs/drawers.yaml"], folder)
    for path, text in compilation.files.items():
        (folder / PACKAGES / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / PACKAGES / path).write_text(text, "utf-8")
    ruff = Path(sys.executable).with_name("ruff")
    command = (ruff, "format", "--isolated", "--line-length", "120", "--diff", folder / PACKAGES)
    assert subprocess.run(command, check=False, capture_output=True).returncode == 0


def drawers(count: int) -> list[str]:
    return [
        f"  {LONG}_{number}: {{type: enum, values: [open, shut_{number}], source: main_execution}}"
        for number in range(count)
    ]


def test_one_enum_with_a_long_name_is_typed(tmp_path: Path) -> None:
    made(drawers(1), tmp_path)
    program = f"""\
from {PACKAGES} import drawers


def use(codra: drawers.Drawers) -> None:
    codra.set("{LONG}_0", "shut_0")
    codra.set("{LONG}_0", "shut")
"""
    assert errors_in(program, tmp_path) == [(f'codra.set("{LONG}_0", "shut")', "arg-type")]


def test_many_enums_with_long_names_stay_readable_and_typed(tmp_path: Path) -> None:
    made([*drawers(MAX_ENUMS + 5), "  ready: {type: bool, source: main_execution}"], tmp_path)
    text = (tmp_path / PACKAGES / "drawers/__init__.py").read_text("utf-8")
    assert text.count("def get(") == MAX_ENUMS + 4
    program = f"""\
from {PACKAGES} import drawers


def use(codra: drawers.Drawers) -> None:
    first: str = codra.get("{LONG}_0").value
    last: str = codra.get("{LONG}_54").value
    codra.set("{LONG}_0", "shut_1")
    codra.set("{LONG}_54", first + last)
"""
    assert errors_in(program, tmp_path) == [
        (f'codra.set("{LONG}_0", "shut_1")', "call-overload"),
    ]
