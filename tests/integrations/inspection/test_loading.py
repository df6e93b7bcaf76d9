"""Compiling a spec and importing its package, from a file, a value or a build plan."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from codra_dsl.compiler import plan_paths
from codra_dsl.integrations.inspection import SpecError, compile_and_load, load_package, read_spec, source_files
from codra_dsl.runtime import SimClock
from codra_dsl.runtime.journal import Kind

DOOR_SPEC = """\
codra: 1
name: door
include: [part.yaml]
context:
  door_open: {type: bool, source: main_execution}
"""
LIGHT_PART = "codra: 1\ncontext:\n  light_on: {type: bool, source: main_execution}\n"
ROOT = Path(__file__).parents[3]


@pytest.fixture
def spec_path(tmp_path: Path) -> Path:
    (tmp_path / "pyproject.toml").write_text("[tool.codra]\n")
    (tmp_path / "part.yaml").write_text(LIGHT_PART)
    path = tmp_path / "door.yaml"
    path.write_text(DOOR_SPEC)
    return path


def test_a_file_a_value_and_a_plan_give_the_same_package(spec_path: Path, tmp_path: Path) -> None:
    (plan,) = plan_paths([spec_path], tmp_path).plans
    sources = (spec_path, read_spec(spec_path), plan)
    compiled_specs = [compile_and_load(source, tmp_path / str(number)) for number, source in enumerate(sources)]

    assert [{variable.name for variable in compiled_spec.spec.context} for compiled_spec in compiled_specs] == [
        {"door_open", "light_on"}
    ] * 3
    assert len({compiled_spec.package.__name__ for compiled_spec in compiled_specs}) == 3
    assert [compiled_spec.loops for compiled_spec in compiled_specs] == [None, None, None]
    for compiled_spec in compiled_specs:
        with compiled_spec.start(clock=SimClock(), resources={}) as codra:
            assert not codra.get("door_open").known


def test_a_spec_with_loops_has_them(tmp_path: Path) -> None:
    assert compile_and_load(ROOT / "specs/store.yaml", tmp_path).loops is not None


def test_an_error_in_a_spec_is_raised_with_its_message(spec_path: Path, tmp_path: Path) -> None:
    spec_path.write_text(DOOR_SPEC.replace("type: bool", "type: float, range: [2, 1]"))

    with pytest.raises(SpecError, match="range"):
        compile_and_load(spec_path, tmp_path / "made")
    with pytest.raises(SpecError, match="range"):
        source_files(spec_path)


def test_a_file_that_is_not_a_spec_is_refused(spec_path: Path, tmp_path: Path) -> None:
    spec_path.write_text("name: [")

    with pytest.raises(SpecError):
        read_spec(spec_path)
    with pytest.raises(SpecError):
        compile_and_load(spec_path, tmp_path / "made")


def test_a_spec_that_was_changed_in_memory_is_compiled(spec_path: Path, tmp_path: Path) -> None:
    changed_spec = read_spec(spec_path)
    changed_spec = replace(
        changed_spec, context=tuple(variable for variable in changed_spec.context if variable.name == "light_on")
    )

    variables = compile_and_load(changed_spec, tmp_path / "made").package.MODEL.variables
    assert [variable.name for variable in variables] == ["light_on"]


def test_the_source_files_are_the_spec_and_its_included_parts(spec_path: Path, tmp_path: Path) -> None:
    assert set(source_files(spec_path)) == {tmp_path / "door.yaml", tmp_path / "part.yaml"}


def test_a_folder_without_a_package_cannot_be_imported(tmp_path: Path) -> None:
    with pytest.raises((ImportError, FileNotFoundError)):
        load_package(tmp_path)


def test_in_a_world_the_functions_of_hosts_run_in_the_same_program(tmp_path: Path) -> None:
    spec = read_spec(ROOT / "specs/kitchen.yaml")
    hosted_spec = replace(spec, perception=tuple(replace(algorithm, host="arm_pc") for algorithm in spec.perception))
    start = compile_and_load(hosted_spec, tmp_path / "made").start
    resources = {resource.name: SimpleNamespace() for resource in spec.resources if resource.slots is None}
    with start(clock=SimClock(), resources=resources) as codra:
        assert codra.hosts.names == {"arm_pc"}
        assert [event.what for event in codra.record.of(Kind.HOST)] == ["connected"]
