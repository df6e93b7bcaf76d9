"""The cache: a run has the same results with and without it; and a run in which nothing changed is short."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from importlib.machinery import PathFinder
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule
from typer.testing import CliRunner

from codra_dsl import compiler
from codra_dsl.cli.app import app
from codra_dsl.compiler import lint_paths
from codra_dsl.generation import build_plan
from codra_dsl.language.load import load_spec
from codra_dsl.workspace.cache import FOLDER, SpecResults, inputs, stored_files
from codra_dsl.workspace.cache.signatures import SECRET_FILE, signature

DOOR = """\
codra: 1
name: door
include: [parts/lamp.yaml]
context:
  door_open: {type: bool, valid_for: 20 s}
perception:
  measure_door:
    call: robot.doors:measure
    returns: {gap: {type: float, unit: m}}
    observable_when: [lit]
    identifies: {door_open: gap > 40 cm}
skills:
  pass_door: {preview: [door_open]}
"""
LAMP = """\
codra: 1
context:
  lit: {type: bool, source: main_execution, valid_for: 1 min}
"""
WINDOW = (
    DOOR.replace("door", "window")
    .replace("include: [parts/lamp.yaml]\n", "")
    .replace("context:\n", "context:\n  lit: {type: bool, source: main_execution, valid_for: 1 min}\n")
)
FILES = {
    "specs/door.yaml": st.sampled_from(
        [
            DOOR,
            DOOR.replace("40 cm", "50 cm"),
            DOOR + "# a comment\n",
            DOOR.replace("context:", "context:\n  unused: {type: bool, source: main_execution}"),
            DOOR.replace("lit", "lid"),
            DOOR.replace("[parts/lamp.yaml]", "[parts/lump.yaml]"),
            "codra: 1\nname: [",
        ]
    ),
    "specs/window.yaml": st.sampled_from([WINDOW, WINDOW.replace("name: window", "name: door"), "no: spec\n", None]),
    "specs/parts/lamp.yaml": st.sampled_from([LAMP, LAMP.replace("1 min", "2 min"), "", None]),
    "robot/doors.py": st.sampled_from(["def measure(job): ...\n", "def measures(job): ...\n", "(", None]),
    "pyproject.toml": st.sampled_from(
        [
            "[tool.codra]\n",
            '[tool.codra.lint]\nignore = ["CDR7"]\n',
            '[tool.codra.lint]\nfail-on = "warning"\n',
            "[tool.codra.lint]\nignore = 1\n",
        ]
    ),
}
COMMANDS = st.sampled_from(
    [
        ["lint", "specs"],
        ["lint", "specs/door.yaml", "--format", "json"],
        ["lint", "specs", "--fail-on", "warning"],
        ["compile", "specs"],
        ["compile", "specs", "--check"],
        ["compile", "specs/door.yaml"],
        ["compile", "specs", "--out", "elsewhere"],
    ]
)
LIBRARIES = ("jinja2", "jsonschema", "jsonschema_rs", "networkx", "yaml")


def run(folder: Path, *arguments: str) -> tuple[int, str, str]:
    """Run a command in a folder, in this process."""
    before = Path.cwd()
    os.chdir(folder)
    try:
        done = CliRunner().invoke(app, arguments)
    finally:
        os.chdir(before)
    return done.exit_code, done.stdout, done.stderr


def content(folder: Path) -> dict[str, bytes]:
    """Every file of a project except those of the cache."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file() and FOLDER not in path.parts)
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


class WarmAndCold(RuleBasedStateMachine):
    """Two projects with the same edits: one is compiled with the cache, the other without it."""

    def __init__(self) -> None:
        super().__init__()
        self._folder = TemporaryDirectory()
        self._warm, self._cold = (Path(self._folder.name, name, "project") for name in ("warm", "cold"))
        for path, text in (
            ("specs/door.yaml", DOOR),
            ("specs/window.yaml", WINDOW),
            ("specs/parts/lamp.yaml", LAMP),
            ("pyproject.toml", "[tool.codra]\n"),
        ):
            self._write(path, text)

    def teardown(self) -> None:
        self._folder.cleanup()

    def _write(self, path: str, text: str | None) -> None:
        for project in (self._warm, self._cold):
            file = project / path
            if text is None:
                file.unlink(missing_ok=True)
            else:
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(text, "utf-8")

    def _outputs(self) -> list[str]:
        made = content(self._cold)
        return [path for path in made if path.startswith(("generated/", "elsewhere/"))]

    @rule(data=st.data(), path=st.sampled_from(sorted(FILES)))
    def edit(self, data: st.DataObject, path: str) -> None:
        self._write(path, data.draw(FILES[path]))

    @precondition(lambda self: self._outputs())
    @rule(data=st.data(), text=st.sampled_from(["", "edited = True\n", None]))
    def edit_output(self, data: st.DataObject, text: str | None) -> None:
        self._write(data.draw(st.sampled_from(self._outputs())), text)

    @rule(path=st.sampled_from(["generated/door/more.py", "generated/more.txt", "generated/other/own.py"]))
    def add_output(self, path: str) -> None:
        self._write(path, "more = True\n")

    @rule(data=st.data(), path=st.sampled_from(sorted(FILES)))
    def touch(self, data: st.DataObject, path: str) -> None:
        """Only the contents of a file matter, not the time of writing."""
        for project in (self._warm, self._cold):
            if (project / path).exists():
                time_ns = data.draw(st.integers(0, 2_000_000_000)) * 10**9
                os.utime(project / path, ns=(time_ns, time_ns))

    @rule(
        data=st.data(),
        text=st.sampled_from([b"", b"{", b"[]", b'{"run": 1}', b"\xff", b'{"made_with": "", "inputs": {}, "run": {}}']),
    )
    def damage_the_cache(self, data: st.DataObject, text: bytes) -> None:
        kept = sorted((self._warm / FOLDER).glob("*.json"))
        if kept:
            data.draw(st.sampled_from(kept)).write_bytes(text)

    @rule(command=COMMANDS, times=st.integers(1, 2))
    def compare(self, command: list[str], times: int) -> None:
        for _ in range(times):
            assert run(self._warm, *command) == run(self._cold, *command, "--no-cache")

    @invariant()
    def both_hold_the_same(self) -> None:
        assert content(self._warm) == content(self._cold)


TestWarmAndCold = WarmAndCold.TestCase
TestWarmAndCold.settings = settings(max_examples=10, stateful_step_count=15, deadline=None)


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", f"{tmp_path}-user-cache")
    for path, text in (("door.yaml", DOOR), ("parts/lamp.yaml", LAMP), ("pyproject.toml", "[tool.codra]\n")):
        (tmp_path / path).parent.mkdir(exist_ok=True)
        (tmp_path / path).write_text(text, "utf-8")
    return tmp_path


def secret_file(project: Path) -> Path:
    return Path(f"{project}-user-cache", SECRET_FILE)


def read_stored(file: Path) -> Any:
    """Return the data of a stored run, without its signature."""
    return json.loads(file.read_bytes().partition(b"\n")[2])


def store_signed(project: Path, file: Path, stored_record: object, *arguments: str) -> None:
    """Store a run as the user's own run of a command would."""
    data = json.dumps(stored_record).encode()
    key = "\0".join([str(project), "codra-cache-3", *arguments])
    file.write_bytes(signature(secret_file(project).read_bytes(), key, data) + b"\n" + data)


WHICH = """
import sys
from codra_dsl.cli.app import command_line
code = command_line()
print(*sorted({library} & set(sys.modules)), code, file=sys.stderr)
"""


def imported(project: Path, *arguments: str) -> list[str]:
    """Run a command in a separate process; return the libraries of the compiler that it imported, and its exit code."""
    done = subprocess.run(
        [sys.executable, "-c", WHICH.format(library=set(LIBRARIES)), *arguments],
        cwd=project,
        text=True,
        capture_output=True,
        check=True,
    )
    return done.stderr.splitlines()[-1].split()


@pytest.mark.parametrize("command", ["lint", "compile"])
def test_a_run_in_which_nothing_changed_imports_no_library_of_the_compiler(project: Path, command: str) -> None:
    first, second = imported(project, command, "door.yaml"), imported(project, command, "door.yaml")

    assert "yaml" in first
    assert second == ["0"]


def test_a_run_is_stored_as_data_in_a_folder_that_git_ignores(project: Path) -> None:
    run(project, "compile", "door.yaml")

    assert (project / FOLDER / ".gitignore").read_text() == "*\n"
    (kept,) = (project / FOLDER).glob("run-*.json")
    assert read_stored(kept)["run"]["specs"] == ["door.yaml"]


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("parts/lumq.yaml", LAMP),
        ("parts/lumps.yaml", LAMP),
        ("robot/doors.py", "def measures(job): ...\n"),
        ("robots/doors.py", "def measure(job): ...\n"),
        ("pyproject.toml", "[tool.codra.lint.severity]\nCDR7 = 'warn'\n"),
    ],
    ids=["a part", "a similar part", "a module", "a similar module", "settings"],
)
@pytest.mark.parametrize("command", ["lint", "compile"])
def test_a_file_that_was_searched_and_did_not_exist_changes_the_result_when_it_appears(
    project: Path, command: str, path: str, text: str
) -> None:
    if path.startswith("parts"):
        (project / "door.yaml").write_text(DOOR.replace("parts/lamp", "parts/lumq"))
        (project / "parts/lamp.yaml").unlink()
    before = run(project, command, ".")
    assert run(project, command, ".")[:2] == before[:2]

    (project / path).parent.mkdir(exist_ok=True)
    (project / path).write_text(text)
    after = run(project, command, ".")

    assert after[1] != before[1]
    assert after[:2] == run(project, command, ".", "--no-cache")[:2]


def test_without_the_cache_no_run_is_stored(project: Path) -> None:
    run(project, "lint", "door.yaml", "--no-cache")

    assert not (project / FOLDER).exists()


def test_outside_of_a_project_no_run_is_stored(project: Path) -> None:
    (project / "pyproject.toml").unlink()

    assert run(project, "lint", "door.yaml")[0] == 0
    assert not (project / FOLDER).exists()


def test_a_run_that_cannot_be_stored_has_the_same_output(project: Path) -> None:
    expected = run(project, "lint", "door.yaml", "--no-cache")
    (project / FOLDER).write_text("in the way")

    assert run(project, "lint", "door.yaml") == expected


@pytest.mark.parametrize("where", [FOLDER, f"{FOLDER}/.gitignore"])
def test_no_run_is_stored_through_a_link(project: Path, where: str) -> None:
    """A repository can contain links to any place."""
    elsewhere = project.parent / f"{project.name}-elsewhere"
    (project / where).parent.mkdir(exist_ok=True)
    (project / where).symlink_to(elsewhere)
    if where == FOLDER:
        elsewhere.mkdir()

    assert run(project, "lint", "door.yaml")[0] == 0

    assert not elsewhere.is_file()
    assert not elsewhere.is_dir() or not list(elsewhere.iterdir())


def test_in_ci_stored_runs_are_not_used(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stored run may have come with the change that is checked."""
    unused = "context:\n  unused: {type: bool, source: main_execution}\n"
    (project / "door.yaml").write_text(DOOR.replace("context:\n", unused))
    expected = run(project, "lint", "door.yaml")
    (kept,) = (project / FOLDER).glob("run-*.json")
    forged = read_stored(kept)
    forged["run"]["diagnostics"] = []
    store_signed(project, kept, forged, "lint", "door.yaml")
    assert run(project, "lint", "door.yaml") != expected, "outside of CI the stored run is used"

    monkeypatch.setenv("CI", "true")

    assert run(project, "lint", "door.yaml") == expected


def plant(project: Path) -> None:
    """Put `os.system` into the package of a project, and adapt the stored run as the author of the project can."""
    assert run(project, "compile", "door.yaml")[0] == 0
    code = project / "generated/door/door.py"
    code.write_text(code.read_text() + "import os\nos.system('true')\n")
    (kept,) = (project / FOLDER).glob("run-*.json")
    forged = read_stored(kept)
    forged["run"]["outputs"]["door/door.py"] = hashlib.sha256(code.read_bytes()).hexdigest()
    store_signed(project, kept, forged, "compile", "door.yaml")
    results_file = project / FOLDER / "specs.json"
    results = read_stored(results_file)
    (result,) = results["results"].values()
    result["outputs"]["door/door.py"] = forged["run"]["outputs"]["door/door.py"]
    store_signed(project, results_file, results)
    assert run(project, "compile", "door.yaml", "--check")[0] == 0, "the author's own cache accepts the run"
    assert run(project, "compile", ".", "--check")[0] == 0, "the author's own cache accepts the result of the spec"


@pytest.mark.parametrize(("place", "user"), [("", "other-user"), ("-clone", "other-user"), ("-clone", "user-cache")])
def test_a_stored_run_of_somebody_else_does_not_hide_changed_code(
    project: Path, place: str, user: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A project may come with a cache: from another user, or from another folder in which the user ran its code."""
    plant(project)
    clone = Path(f"{project}{place}")
    if place:
        shutil.copytree(project, clone)
    monkeypatch.setenv("XDG_CACHE_HOME", f"{project}-{user}")

    code, text, _ = run(clone, "compile", "door.yaml", "--check")

    assert code == 1
    assert "os.system" in text


def test_only_specs_whose_inputs_changed_are_read_again(project: Path) -> None:
    (project / "window.yaml").write_text(WINDOW)
    (project / "hall.yaml").write_text(WINDOW.replace("window", "hall"))
    results: SpecResults = {}
    lint_paths([project], project, results=results)
    before = dict(results)

    (project / "parts/lamp.yaml").write_text(LAMP.replace("1 min", "2 min"))
    lint_paths([project], project, results=results)

    changed_specs = [results[key].name for key in results if results[key] is not before[key]]
    assert changed_specs == ["door"]


def test_a_text_that_is_saved_later_is_not_read_again(project: Path) -> None:
    text = DOOR.replace("40 cm", "50 cm")
    results: SpecResults = {}
    lint_paths([project], project, results=results)
    unsaved = lint_paths([project], project, {"door.yaml": text.encode()}, results=results)
    (result,) = results.values()

    (project / "door.yaml").write_text(text)
    saved = lint_paths([project], project, results=results)

    assert saved.diagnostics == unsaved.diagnostics
    assert list(results.values()) == [result]
    assert next(iter(results.values())) is result


def test_a_result_without_its_output_is_generated_again(project: Path) -> None:
    (project / "window.yaml").write_text(WINDOW)
    run(project, "compile", ".")
    expected = content(project)
    (project / "generated/door/door.py").unlink()
    (project / "generated/window/window.py").write_text("edited = True\n")

    assert run(project, "compile", ".")[2].endswith("2 written, 0 removed\n")
    assert content(project) == expected


@pytest.mark.parametrize("damage", [0, None, "text", [], {}, [None], [["no_query", "", ""]]])
def test_a_damaged_result_of_a_spec_causes_no_traceback(project: Path, damage: object) -> None:
    expected = run(project, "lint", "door.yaml", "--no-cache")
    run(project, "lint", "door.yaml")
    file = project / FOLDER / "specs.json"
    stored_record = read_stored(file)
    (result,) = stored_record["results"].values()
    result["answers"] = result["answers"][:2]

    for steps in paths_in(stored_record["results"]):
        damaged = json.loads(json.dumps(stored_record))
        holder = damaged["results"]
        for step in steps[:-1]:
            holder = holder[step]
        if isinstance(damage, str) and isinstance(holder[steps[-1]], str):
            continue  # if a text replaces a text, the result is another valid result
        holder[steps[-1]] = damage
        store_signed(project, file, damaged)
        code, _, output = run(project, "lint", ".")
        assert code in (0, 1), output
        assert "Traceback" not in output
    file.unlink()
    assert run(project, "lint", ".") == expected


def test_a_run_during_which_a_module_changes_is_not_shown_again(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The spec that is read first has a finding about the old text of the module, and the other spec has none."""
    module = project / "robot/doors.py"
    module.parent.mkdir()
    module.write_text("def measures(job): ...\n")
    (project / "window.yaml").write_text(WINDOW.replace("robot.windows", "robot.doors"))

    def load_and_edit(*arguments: Any) -> Any:
        loaded = load_spec(*arguments)
        module.write_text("def measure(job): ...\n")
        return loaded

    with monkeypatch.context() as editing:
        editing.setattr(compiler, "load_spec", load_and_edit)
        run(project, "lint", ".")

    assert run(project, "lint", ".") == run(project, "lint", ".", "--no-cache")


def test_a_run_that_fails_its_verification_is_not_stored(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    attempts = []

    def fail(*_: object) -> None:
        attempts.append("verified")
        raise ValueError("an edge is missing")

    assert run(project, "compile", "door.yaml")[0] == 0
    shutil.rmtree(project / FOLDER)
    monkeypatch.setattr(build_plan, "verify", fail)
    for _ in range(2):
        assert run(project, "compile", "door.yaml", "--check")[0] == 1
    assert attempts == ["verified", "verified"]


def test_the_number_of_stored_files_is_limited(project: Path) -> None:
    run(project, "lint", "door.yaml")
    for number in range(110):
        file = project / FOLDER / f"tmp{number}"
        file.touch()
        os.utime(file, (number, number))
    os.utime(project / FOLDER / "specs.json", (0, 0))

    run(project, "lint", ".")

    names = {file.name for file in (project / FOLDER).iterdir()}
    assert len(names - {".gitignore", "specs.json"}) == 100
    assert {".gitignore", "specs.json", "tmp109"} <= names
    assert "tmp0" not in names
    assert len([name for name in names if name.startswith("run-")]) == 2


def test_an_interrupted_write_leaves_no_file(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    run(project, "lint", "door.yaml")
    before = sorted((project / FOLDER).iterdir())
    monkeypatch.setattr(Path, "replace", interrupt)
    (project / "door.yaml").write_text(DOOR.replace("40 cm", "50 cm"))
    run(project, "lint", "door.yaml")

    assert sorted((project / FOLDER).iterdir()) == before


def test_without_a_digest_of_the_compiler_a_run_is_not_stored(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """For example, an editor's lock in the folder of an editable installation is a link that leads nowhere."""
    expected = run(project, "lint", "door.yaml", "--no-cache")

    def digest() -> str:
        raise FileNotFoundError

    monkeypatch.setattr(stored_files, "compiler_digest", digest)

    assert run(project, "lint", "door.yaml") == expected
    assert not list((project / FOLDER).glob("*.json"))


@pytest.mark.parametrize("library", LIBRARIES)
def test_another_version_of_a_library_changes_the_digest(
    library: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / library).mkdir()
    (tmp_path / library / "__init__.py").touch()
    metadata = tmp_path / f"{library}-1.0.dist-info"
    metadata.mkdir()
    monkeypatch.setattr(inputs, "find_spec", partial(PathFinder.find_spec, path=[str(tmp_path)]))
    before = inputs.compiler_digest.__wrapped__()

    metadata.rename(tmp_path / f"{library}-1.1.dist-info")

    assert inputs.compiler_digest.__wrapped__() != before


def test_a_stored_run_without_a_signature_is_ignored(project: Path) -> None:
    run(project, "lint", "door.yaml")
    (kept,) = (project / FOLDER).glob("run-*.json")
    kept.write_bytes(kept.read_bytes().partition(b"\n")[2])

    assert "yaml" in imported(project, "lint", "door.yaml")


def test_the_secret_is_private_and_one_that_others_can_read_is_replaced(project: Path) -> None:
    run(project, "lint", "door.yaml")
    file = secret_file(project)
    first = file.read_bytes()
    assert (len(first), file.stat().st_mode & 0o777) == (32, 0o600)
    assert sorted(file.parent.iterdir()) == [file]

    file.chmod(0o644)
    run(project, "lint", "door.yaml")

    assert file.read_bytes() != first
    assert file.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize("place", ["a file", "the project"])
def test_without_a_secret_outside_of_the_project_nothing_is_stored(
    project: Path, place: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = run(project, "lint", "door.yaml", "--no-cache")
    folder = project / "cache" if place == "the project" else project / "door.yaml"
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder))

    assert run(project, "lint", "door.yaml") == expected
    assert not (project / FOLDER).exists()
    assert not (project / "cache").exists()


def test_a_pipe_instead_of_a_stored_run_does_not_block(project: Path) -> None:
    expected = run(project, "lint", "door.yaml")
    (kept,) = (project / FOLDER).glob("run-*.json")
    kept.unlink()
    os.mkfifo(kept)

    assert run(project, "lint", "door.yaml") == expected


def test_runs_of_an_older_version_of_codra_are_not_used(project: Path) -> None:
    run(project, "lint", "door.yaml")
    (kept,) = (project / FOLDER).glob("run-*.json")
    older = read_stored(kept) | {"made_with": "an older version"}
    store_signed(project, kept, older, "lint", "door.yaml")

    assert "yaml" in imported(project, "lint", "door.yaml")
    assert read_stored(kept) != older


@pytest.mark.parametrize("damage", [0, -1, 7.5, None, True, "text", [], {}, [None], [["", 1, 1, 1, 1]]])
def test_a_damaged_stored_run_causes_no_traceback(project: Path, damage: object) -> None:
    """One stored value after another is replaced by something else. The run then behaves as if nothing were stored."""
    (project / "door.yaml").write_text(
        DOOR.replace("context:", "context:\n  unused: {type: bool, source: main_execution}")
    )
    expected = run(project, "lint", "door.yaml", "--no-cache")
    run(project, "lint", "door.yaml")
    (file,) = (project / FOLDER).glob("run-*.json")
    stored_record = read_stored(file)
    stored_record["run"]["answers"] = stored_record["run"]["answers"][:1]

    for steps in paths_in(stored_record["run"]):
        damaged = json.loads(json.dumps(stored_record))
        holder = damaged["run"]
        for step in steps[:-1]:
            holder = holder[step]
        if holder[steps[-1]] == damage or (isinstance(damage, str) and isinstance(holder[steps[-1]], str)):
            continue  # if a text replaces a text, the result is another valid run
        holder[steps[-1]] = damage
        store_signed(project, file, damaged, "lint", "door.yaml")
        code, _, output = run(project, "lint", "door.yaml")
        assert code in (0, 1), output
        assert "Traceback" not in output
    file.unlink()
    assert run(project, "lint", "door.yaml") == expected


def paths_in(value: Any, steps: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    if steps:
        yield steps
    for key, inner in value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ():
        yield from paths_in(inner, (*steps, key))
