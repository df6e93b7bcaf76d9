"""Specs become a folder of packages: files are written, stale, refused or removed, and their bytes are reproducible."""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

from codra_dsl.compiler import Compilation, compile_paths
from codra_dsl.generation.emit.self_check import prove
from codra_dsl.generation.output import Change, drift_finding, freshness, write
from codra_dsl.language.project import project_of, root_of

DOOR = """\
codra: 1
name: door
context:
  door_open: {type: bool, valid_for: 10 s}
perception:
  measure_door:
    call: some_robot.doors:measure
    returns:
      gap: {type: float, unit: m}
    identifies:
      door_open: gap > 40 cm
skills:
  pass_door:
    preview: [door_open]
"""
WINDOW = DOOR.replace("door", "window")


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A project with two specs."""
    (tmp_path / "pyproject.toml").write_text("[tool.codra]\n")
    (tmp_path / "specs").mkdir()
    (tmp_path / "specs/door.yaml").write_text(DOOR)
    (tmp_path / "specs/window.yaml").write_text(WINDOW)
    return tmp_path


def compiled(project: Path, *paths: str) -> Compilation:
    compilation = compile_paths([project / path for path in paths or ("specs",)], project)
    prove(compilation.files)
    return compilation


def renew(project: Path, *paths: str) -> tuple[set[str], set[str]]:
    """Compile and write; return the changed and the removed files."""
    compilation = compiled(project, *paths)
    written = write(compilation.files, project / "generated", compilation.covered)
    assert written.diagnostics == ()
    return set(written.changed), set(written.removed)


def drifts(project: Path, *paths: str) -> dict[str, Change]:
    compilation = compiled(project, *paths)
    compared = freshness(compilation.files, project / "generated", compilation.covered)
    assert compared.diagnostics == ()
    return {drift.path: drift.change for drift in compared.drifts}


def contents(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()
    }


# Writing


def test_every_spec_gets_a_separate_package(project: Path) -> None:
    renew(project)

    assert set(contents(project / "generated")) == {
        "__init__.py",
        *(f"{name}/{file}" for name in ("door", "window") for file in (f"{name}.py", "__init__.py")),
        *(f"{name}/{file}.json" for name in ("door", "window") for file in ("graph", "manifest", "sources")),
    }


def test_new_output_is_fresh(project: Path) -> None:
    renew(project)

    assert drifts(project) == {}


def test_writing_again_changes_no_file(project: Path) -> None:
    renew(project)
    before = {path: path.stat().st_mtime_ns for path in (project / "generated").rglob("*")}

    assert renew(project) == (set(), set())
    assert {path: path.stat().st_mtime_ns for path in (project / "generated").rglob("*")} == before


def test_only_changed_files_are_written(project: Path) -> None:
    renew(project)
    (project / "specs/door.yaml").write_text(DOOR.replace("40 cm", "50 cm"))

    assert renew(project) == ({"door/door.py", "door/manifest.json"}, set())


def test_a_comment_in_a_spec_changes_places_only(project: Path) -> None:
    renew(project)
    (project / "specs/door.yaml").write_text(DOOR.replace("context:", "# what we know of the door\ncontext:"))

    assert renew(project) == ({"door/sources.json"}, set())


def test_the_cache_of_python_is_neither_output_nor_orphan(project: Path) -> None:
    renew(project)
    subprocess.run([sys.executable, "-c", "import generated.door"], cwd=project, check=True, env=python_path())

    assert list((project / "generated/door/__pycache__").iterdir()) != []
    assert drifts(project) == {}
    assert renew(project) == (set(), set())


def python_path() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1]), "PYTHONDONTWRITEBYTECODE": ""}


def test_no_temporary_file_is_left_beside_the_output(project: Path) -> None:
    renew(project)

    assert [path.name for path in (project / "generated").iterdir() if path.name.startswith(".")] == []


def test_with_an_error_in_one_spec_no_file_is_emitted(project: Path) -> None:
    (project / "specs/window.yaml").write_text(WINDOW.replace("preview", "previw"))

    assert compiled(project).files == {}
    assert [diagnostic.code for diagnostic in compiled(project).planned.diagnostics] == ["CDR2003"]


# Freshness


@pytest.mark.parametrize(
    "path",
    ["__init__.py", "door/__init__.py", "door/door.py", "door/graph.json", "door/manifest.json", "door/sources.json"],
)
def test_an_edited_file_is_detected_and_renewed(project: Path, path: str) -> None:
    renew(project)
    edited = project / "generated" / path
    edited.write_text(edited.read_text().replace("door", "gate", 1).replace("made from", "built from", 1) + "\n")

    assert drifts(project) == {f"generated/{path}": Change.MODIFIED}
    assert renew(project) == ({path}, set())
    assert drifts(project) == {}


@pytest.mark.parametrize("path", ["__init__.py", "door/door.py", "door/graph.json", "door/sources.json"])
def test_a_missing_file_is_detected_and_made_again(project: Path, path: str) -> None:
    renew(project)
    (project / "generated" / path).unlink()

    assert drifts(project) == {f"generated/{path}": Change.MISSING}
    assert renew(project) == ({path}, set())


@pytest.mark.parametrize("path", ["extra.py", "door/extra.py", "door/notes/read.md"])
def test_an_added_file_is_detected_and_removed(project: Path, path: str) -> None:
    renew(project)
    (project / "generated" / path).parent.mkdir(exist_ok=True)
    (project / "generated" / path).write_text("x = 1\n")

    assert drifts(project) == {f"generated/{path}": Change.ORPHAN}
    assert renew(project) == (set(), {path})
    assert not (project / "generated/door/notes").exists()


def test_a_missing_manifest_shows_as_drift(project: Path) -> None:
    renew(project)
    (project / "generated/door/manifest.json").unlink()

    assert drifts(project) == {"generated/door/manifest.json": Change.MISSING}


def test_a_drift_shows_the_present_and_the_expected_text(project: Path) -> None:
    renew(project)
    edited = project / "generated/door/door.py"
    edited.write_text(edited.read_text().replace("0.4", "0.5"))

    (drift,) = freshness(compiled(project).files, project / "generated").drifts

    lines = [line for line in drift.diff.splitlines() if line[0] in "+-"]
    assert lines == [
        "--- generated/door/door.py (as it is)",
        "+++ generated/door/door.py (as specified)",
        '-            Identify("door_open", value("gap") > 0.5, perception),',
        '+            Identify("door_open", value("gap") > 0.4, perception),',
    ]
    assert drift_finding(drift).code == "CDR6003"


def test_names_that_begin_with_a_dot_are_left_alone(project: Path) -> None:
    renew(project)
    (project / "generated/.gitattributes").write_text("* linguist-generated\n")
    (project / "generated/door/.notes").write_text("mine\n")

    assert drifts(project) == {}
    assert renew(project) == (set(), set())


# Specs that come and go


def test_the_package_of_a_removed_spec_is_an_orphan_when_its_folder_is_compiled(project: Path) -> None:
    renew(project)
    (project / "specs/window.yaml").unlink()

    assert set(drifts(project).values()) == {Change.ORPHAN}
    assert {path.split("/")[1] for path in drifts(project)} == {"window"}
    renew(project)
    assert not (project / "generated/window").exists()


def test_compiling_one_spec_leaves_the_packages_of_others_alone(project: Path) -> None:
    renew(project)

    assert drifts(project, "specs/door.yaml") == {}
    assert renew(project, "specs/door.yaml") == (set(), set())
    assert (project / "generated/window/window.py").exists()


def test_the_old_package_of_a_renamed_spec_is_an_orphan(project: Path) -> None:
    renew(project)
    (project / "specs/door.yaml").write_text(DOOR.replace("name: door", "name: gate"))

    renew(project, "specs/door.yaml")

    assert sorted(path.name for path in (project / "generated").iterdir() if path.is_dir()) == ["gate", "window"]


def test_two_specs_with_the_same_name_are_a_finding(project: Path) -> None:
    (project / "specs/window.yaml").write_text(WINDOW.replace("name: window", "name: Door"))

    (finding,) = compiled(project).planned.diagnostics

    assert (finding.code, finding.place.span.file, finding.place.span.line) == ("CDR6001", "specs/window.yaml", 2)
    assert finding.message == "the name 'Door' is taken by specs/door.yaml"
    assert [related.place.span.file for related in finding.related] == ["specs/door.yaml"]


# Folders that are not ours


def refused(project: Path, out: str) -> tuple[str, str]:
    written = write(compiled(project).files, project / out)
    (finding,) = written.diagnostics
    assert (written.changed, written.removed) == ((), ())
    return finding.code, finding.message


def test_a_folder_that_holds_other_files_is_refused(project: Path) -> None:
    (project / "src").mkdir()
    (project / "src/robot.py").write_text("x = 1\n")
    before = contents(project / "src")

    code, message = refused(project, "src")

    assert code == "CDR6002"
    assert message == "'src' holds files that codra did not make, so nothing is written there"
    assert contents(project / "src") == before
    assert freshness(compiled(project).files, project / "src").diagnostics[0].code == "CDR6002"


def test_a_package_folder_without_a_manifest_of_ours_is_refused(project: Path) -> None:
    renew(project, "specs/window.yaml")
    (project / "generated/door").mkdir()
    (project / "generated/door/mine.py").write_text("x = 1\n")

    assert refused(project, "generated") == (
        "CDR6002",
        "'generated/door' holds files that codra did not make, so nothing is written there",
    )
    assert (project / "generated/door/mine.py").exists()


def test_a_folder_that_is_a_link_is_refused(project: Path) -> None:
    renew(project)
    shutil.move(project / "generated/door", project / "elsewhere")
    (project / "generated/door").symlink_to(project / "elsewhere")

    assert refused(project, "generated")[0] == "CDR6002"


def test_an_output_folder_that_is_a_file_is_refused(project: Path) -> None:
    (project / "generated").write_text("x\n")

    assert refused(project, "generated") == ("CDR6002", "'generated' is not a folder, so nothing is written there")


def test_an_empty_folder_is_taken(project: Path) -> None:
    (project / "generated").mkdir()

    renew(project)

    assert drifts(project) == {}


def test_a_file_that_cannot_be_written_is_a_finding(project: Path) -> None:
    renew(project)
    (project / "generated/door/door.py").unlink()
    (project / "generated/door/door.py").mkdir()
    (project / "generated/door/door.py/inside").write_text("x\n")

    (finding,) = write(compiled(project).files, project / "generated").diagnostics

    assert finding.code == "CDR6004"
    assert "generated/door/door.py" in finding.message


def test_a_manifest_torn_by_a_merge_is_still_ours(project: Path) -> None:
    renew(project)
    manifest = project / "generated/door/manifest.json"
    manifest.write_text(f"<<<<<<< ours\n{manifest.read_text()}=======\n>>>>>>> theirs\n")

    assert renew(project) == ({"door/manifest.json"}, set())


# The same bytes


COMPILE = """
import sys
from pathlib import Path
from codra_dsl.compiler import compile_paths
from codra_dsl.generation.output import write
from codra_dsl.language.project import root_of
paths = [Path(path) for path in sys.argv[2:]]
compilation = compile_paths(paths, root_of(paths[0]))
write(compilation.files, Path(sys.argv[1]), compilation.covered)
"""


def bytes_from_another_process(out: Path, paths: list[str], cwd: Path, settings: Mapping[str, str]) -> dict[str, bytes]:
    subprocess.run([sys.executable, "-c", COMPILE, out, *paths], cwd=cwd, check=True, env={**python_path(), **settings})
    return contents(out)


@pytest.mark.parametrize(
    ("settings", "cwd", "paths"),
    [
        ({"PYTHONHASHSEED": "1"}, ".", ["specs"]),
        ({"PYTHONHASHSEED": "4242"}, ".", ["specs"]),
        ({"LC_ALL": "C", "PYTHONUTF8": "0"}, "specs", ["."]),
        ({"LC_ALL": "tr_TR.UTF-8"}, "specs", ["window.yaml", "door.yaml"]),
        ({"TZ": "Asia/Tokyo"}, "/", ["{project}/specs/door.yaml", "{project}/specs/window.yaml", "{project}/specs"]),
    ],
)
def test_same_specs_same_bytes(project: Path, settings: dict[str, str], cwd: str, paths: list[str]) -> None:
    renew(project)

    made = bytes_from_another_process(
        project / "other/generated", [path.format(project=project) for path in paths], project / cwd, settings
    )

    assert made == contents(project / "generated")


def test_another_place_on_disk_gives_the_same_bytes(project: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    renew(project)
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "copy of it"
    shutil.copytree(project, elsewhere, ignore=shutil.ignore_patterns("generated"))

    renew(elsewhere)

    assert contents(elsewhere / "generated") == contents(project / "generated")


# Projects


def test_the_root_is_the_nearest_folder_with_settings_for_codra(project: Path) -> None:
    (project / "specs/pyproject.toml").write_text("[tool.other]\n")

    assert project_of(project / "specs/door.yaml") == project
    assert root_of(project / "specs/door.yaml") == project


def test_without_a_project_the_root_is_the_folder_of_the_spec(tmp_path: Path) -> None:
    (tmp_path / "door.yaml").write_text(DOOR)

    assert project_of(tmp_path) is None
    assert root_of(tmp_path / "door.yaml") == tmp_path
    assert root_of(tmp_path) == tmp_path


def test_settings_that_cannot_be_read_make_no_project(tmp_path: Path) -> None:
    (tmp_path / "pyproject.toml").write_bytes(b"\xff[tool.codra")

    assert project_of(tmp_path) is None


# Paths that cannot be written


def test_a_folder_in_which_nothing_can_be_made_is_named_with_its_whole_path() -> None:
    (finding,) = write({"__init__.py": ""}, Path("/proc/codra")).diagnostics

    assert (finding.rule.name, finding.place.span.file) == ("cannot-write", "/proc/codra")
    assert finding.message == "cannot write '/proc/codra': No such file or directory"


def test_a_temporary_file_that_cannot_be_written_is_reported_as_the_output_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "generated").mkdir()
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, before[1]))
    try:
        (finding,) = write({"__init__.py": '"""Text."""\n'}, tmp_path / "generated").diagnostics
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)

    assert finding.message == "cannot write 'generated': File too large"


def test_the_folder_without_a_spec_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()

    (finding,) = compile_paths([Path("empty")], root_of(Path("empty"))).planned.diagnostics

    assert (finding.rule.name, finding.place.span.file) == ("no-spec", "empty")
    assert finding.message == "there is no spec in 'empty' or below"
