"""`codra` in real processes: output streams, exit codes, and no tracebacks."""

from __future__ import annotations

import contextlib
import json
import os
import pty
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pygraphviz
import pytest

from generated import lab
from tests.campaigns.whys.arena import run_until
from tests.command_server import as_text, run_codra, run_python
from tests.test_compiler import DOOR

ROOT = Path(__file__).parents[2]
MISSPELT = DOOR.replace("preview", "moniter")
WITH_WARNING = DOOR.replace("perception:", "  unused: {type: bool, source: main_execution}\nperception:")
MONITER = """\
specs/door.yaml:14:5: error[CDR2003]: unknown key 'moniter' in skill 'pass_door'
   |
14 |     moniter: [door_open]
   |     ^^^^^^^ help: did you mean 'monitor'?
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    (tmp_path / "pyproject.toml").write_text("[tool.codra]\n")
    (tmp_path / "specs").mkdir()
    (tmp_path / "specs/door.yaml").write_text(DOOR)
    return tmp_path


def environment(**settings: str) -> dict[str, str]:
    kept = {
        name: value for name, value in os.environ.items() if name not in ("NO_COLOR", "FORCE_COLOR", "GITHUB_ACTIONS")
    }
    return {
        **kept,
        "PYTHONPATH": os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH")))),
        "COLUMNS": "120",
        **settings,
    }


def codra(*arguments: str, cwd: Path, stdin: str = "", **settings: str) -> subprocess.CompletedProcess[str]:
    process = as_text(run_codra(arguments, cwd, environment(**settings), stdin.encode()))
    assert "Traceback" not in process.stdout + process.stderr
    return process


# Help and usage


HEAVY_LIBRARIES = {"pydantic", "networkx", "jinja2", "jsonschema", "rich", "numpy", "py_trees", "mujoco", "asyncio"}


@pytest.mark.parametrize(
    ("arguments", "libraries"),
    [
        (["--help"], HEAVY_LIBRARIES | {"yaml"}),
        (
            ["lint", "specs/kitchen.yaml", "--no-cache", "--format", "concise"],
            HEAVY_LIBRARIES | {"codra_dsl.language.check.loops.rule_clauses"},
        ),
    ],
)
def test_a_command_imports_no_heavy_library_that_it_does_not_need(arguments: list[str], libraries: set[str]) -> None:
    program = (
        f"import sys; from codra_dsl.cli import main; sys.argv = ['codra', *{arguments}]\n"
        "try: main()\n"
        "except SystemExit as error: print(error.code)\n"
        f"print(sorted({libraries} & set(sys.modules)))"
    )

    process = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, env=environment(), text=True, capture_output=True, check=True
    )

    assert process.stdout.splitlines()[-2:] == ["0", "[]"]


def test_a_replay_imports_neither_the_compiler_nor_the_libraries_of_the_compiler(tmp_path: Path) -> None:
    run_until(lab, 0, 2.0, tmp_path / "run.mcap").manager.close()
    program = (
        f"import sys; from codra_dsl.cli import main; sys.argv = ['codra', 'replay', '{tmp_path}/run.mcap']\n"
        "try: main()\n"
        "except SystemExit as error: print(error.code)\n"
        "print(sorted({'codra_dsl.compiler', 'jinja2', 'pydantic', 'yaml'} & set(sys.modules)))"
    )

    process = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, env=environment(), text=True, capture_output=True, check=True
    )

    assert process.stdout.splitlines()[-2:] == ["0", "[]"]


def test_the_grammars_of_rfc3987_syntax_are_not_built_where_it_is_installed(project: Path, tmp_path: Path) -> None:
    (tmp_path / "rfc3987_syntax.py").write_text("print('built'); is_valid_syntax = None")
    (project / "specs/door.yaml").write_text(MISSPELT)

    process = subprocess.run(
        [sys.executable, "-m", "codra_dsl", "lint", "specs"],
        cwd=project,
        env=environment(PYTHONPATH=os.pathsep.join(map(str, (ROOT, tmp_path)))),
        text=True,
        capture_output=True,
        check=False,
    )

    assert (process.returncode, "built" in process.stdout) == (1, False)


@pytest.mark.parametrize("command", [[], ["compile"], ["lint"], ["graph"]])
def test_every_command_explains_itself(command: list[str]) -> None:
    process = codra(*command, "--help", cwd=ROOT)

    assert process.returncode == 0
    assert process.stdout.startswith(" ".join(["Usage: codra", *command]))


def test_the_version_is_printed() -> None:
    assert codra("--version", cwd=ROOT).stdout.startswith("codra 0.")


@pytest.mark.parametrize(
    "arguments",
    [
        ["lint"],
        ["lint", "nowhere"],
        ["compile", "nowhere.yaml"],
        ["graph", "nowhere"],
        ["lint", "specs", "--format", "xml"],
        ["compile", "specs", "--out"],
        ["graph", "specs", "--format", "full"],
        ["lint", "specs", "--no-such-option"],
        ["frobnicate"],
        ["lint", "specs", "--output", "no/such/folder/findings.txt"],
    ],
)
def test_a_usage_error_exits_with_2(project: Path, arguments: list[str]) -> None:
    process = codra(*arguments, cwd=project)

    assert (process.returncode, process.stdout) == (2, "")
    assert "Error" in process.stderr


def test_specs_of_several_projects_are_taken_one_at_a_time(
    project: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    other = tmp_path_factory.mktemp("other")
    (other / "window.yaml").write_text(DOOR)

    process = codra("compile", "specs", str(other), cwd=project)

    assert process.returncode == 2
    assert "several projects" in process.stderr


# lint


def test_lint_prints_findings_to_standard_output_and_their_number_to_standard_error(project: Path) -> None:
    (project / "specs/door.yaml").write_text(MISSPELT)

    process = codra("lint", "specs", cwd=project)

    assert (process.returncode, process.stdout, process.stderr) == (1, MONITER, "1 error; --fix can fix 1\n")


def test_lint_of_good_specs_leaves_standard_output_empty(project: Path) -> None:
    process = codra("lint", "specs", cwd=project)

    assert (process.returncode, process.stdout, process.stderr) == (0, "", "no findings\n")


def test_paths_in_findings_are_relative_to_the_project_in_every_working_folder(project: Path) -> None:
    (project / "specs/door.yaml").write_text(MISSPELT)

    assert codra("lint", "door.yaml", cwd=project / "specs").stdout == MONITER
    assert codra("lint", str(project / "specs"), cwd=ROOT).stdout == MONITER


@pytest.mark.parametrize(
    ("form", "expected"),
    [
        ("full", MONITER),
        (
            "concise",
            "specs/door.yaml:14:5: error[CDR2003]: unknown key 'moniter' in skill 'pass_door'"
            " (did you mean 'monitor'?)\n",
        ),
    ],
)
def test_findings_have_forms_for_people(project: Path, form: str, expected: str) -> None:
    (project / "specs/door.yaml").write_text(MISSPELT)

    assert codra("lint", "specs", "--format", form, cwd=project).stdout == expected


def test_findings_as_json_are_one_object_a_line(project: Path) -> None:
    (project / "specs/door.yaml").write_text(MISSPELT.replace("timeout", "").replace("gap: {", "gap: {uint: m, "))

    process = codra("lint", "specs", "--format", "json", cwd=project)

    findings = [json.loads(line) for line in process.stdout.splitlines()]
    assert [(finding["code"], finding["line"], finding["column"]) for finding in findings] == [
        ("CDR2003", 9, 13),
        ("CDR2003", 14, 5),
    ]


def test_findings_can_go_to_a_file(project: Path) -> None:
    (project / "specs/door.yaml").write_text(MISSPELT)

    process = codra("lint", "specs", "--output", "findings.txt", cwd=project)

    assert (process.returncode, process.stdout) == (1, "")
    assert (project / "findings.txt").read_text() == MONITER


def test_a_spec_can_come_by_standard_input(project: Path) -> None:
    process = codra("lint", "-", cwd=project, stdin=MISSPELT)

    assert (process.returncode, process.stdout) == (1, MONITER.replace("specs/door.yaml", "-"))


def test_bytes_that_are_not_text_are_a_finding(project: Path) -> None:
    command = [sys.executable, "-m", "codra_dsl", "lint", "-"]

    process = subprocess.run(
        command, cwd=project, env=environment(), input=b"codra: 1\nname: \xff\n", capture_output=True, check=False
    )

    assert process.returncode == 1
    assert b"CDR1002" in process.stdout


@pytest.mark.parametrize(("options", "code"), [([], 0), (["--fail-on", "warning"], 1), (["--fail-on", "error"], 0)])
def test_warnings_fail_only_when_asked(project: Path, options: list[str], code: int) -> None:
    (project / "specs/door.yaml").write_text(WITH_WARNING)

    process = codra("lint", "specs", *options, cwd=project)

    assert (process.returncode, process.stderr) == (code, "1 warning\n")


# Colours


@pytest.mark.parametrize(
    ("options", "settings", "is_coloured"),
    [
        ([], {}, False),
        (["--color", "always"], {}, True),
        (["--color", "always"], {"NO_COLOR": "1"}, True),
        (["--color", "never"], {}, False),
    ],
)
def test_a_pipe_gets_colours_only_when_asked(
    project: Path, options: list[str], settings: dict[str, str], is_coloured: bool
) -> None:
    (project / "specs/door.yaml").write_text(MISSPELT)

    process = codra("lint", "specs", *options, cwd=project, **settings)

    assert ("\x1b[" in process.stdout) is is_coloured


@pytest.mark.parametrize(
    ("settings", "is_coloured"), [({}, True), ({"NO_COLOR": "1"}, False), ({"TERM": "dumb"}, False)]
)
def test_a_terminal_gets_colours_unless_the_environment_forbids_them(
    project: Path, settings: dict[str, str], is_coloured: bool
) -> None:
    (project / "specs/door.yaml").write_text(MISSPELT)
    ours, theirs = pty.openpty()

    with subprocess.Popen(
        [sys.executable, "-m", "codra_dsl", "lint", "specs"],
        cwd=project,
        env=environment(TERM="xterm") | settings,
        stdout=theirs,
        stderr=subprocess.DEVNULL,
    ) as process:
        process.wait()
    shown = os.read(ours, 65536)
    os.close(theirs)
    os.close(ours)

    assert (b"\x1b[1;31merror" in shown) is is_coloured


# compile


def test_compile_writes_packages_and_reports_them_on_standard_error(project: Path) -> None:
    first, second = (codra("compile", "specs", cwd=project) for _ in range(2))

    assert (first.returncode, first.stdout, first.stderr) == (0, "", "generated: 6 files, 6 written, 0 removed\n")
    assert second.stderr == "generated: 6 files, 0 written, 0 removed\n"
    assert (project / "generated/door/door.py").exists()


def test_packages_go_to_the_projects_root_from_every_working_folder(project: Path) -> None:
    codra("compile", "door.yaml", cwd=project / "specs")

    assert (project / "generated/door").is_dir()


def test_without_a_project_packages_go_to_the_working_folder(tmp_path: Path) -> None:
    (tmp_path / "door.yaml").write_text(DOOR)
    (tmp_path / "elsewhere").mkdir()

    codra("compile", "../door.yaml", cwd=tmp_path / "elsewhere")

    assert (tmp_path / "elsewhere/generated/door").is_dir()


def test_compile_writes_no_file_when_there_are_errors(project: Path) -> None:
    (project / "specs/door.yaml").write_text(MISSPELT)

    process = codra("compile", "specs", cwd=project)

    assert (process.returncode, process.stdout) == (1, MONITER)
    assert not (project / "generated").exists()


def test_check_passes_on_written_packages_even_after_they_were_imported(project: Path) -> None:
    codra("compile", "specs", cwd=project)
    subprocess.run(
        [sys.executable, "-c", "import generated.door"],
        cwd=project,
        env=environment(PYTHONDONTWRITEBYTECODE=""),
        check=True,
    )

    process = codra("compile", "specs", "--check", cwd=project)

    assert (project / "generated/door/__pycache__").exists()
    assert (process.returncode, process.stdout) == (0, "")


def test_check_shows_missing_files_and_does_not_write_them(project: Path) -> None:
    process = codra("compile", "specs", "--check", cwd=project)

    assert process.returncode == 1
    assert "+++ generated/door/door.py (as specified)\n" in process.stdout
    assert "'generated/door/door.py' does not match the specs: missing\n" in process.stdout
    assert process.stderr == "6 errors\n"
    assert not (project / "generated").exists()


@pytest.mark.parametrize(
    ("spoil", "shown"),
    [
        (lambda folder: (folder / "door/door.py").write_text("x = 1\n"), "-x = 1\n"),
        (lambda folder: (folder / "door/graph.json").unlink(), "+++ generated/door/graph.json (as specified)\n"),
        (lambda folder: (folder / "door/extra.py").write_text("y = 2\n"), "-y = 2\n"),
        (lambda folder: (folder / "__init__.py").write_text("z = 3\n"), "-z = 3\n"),
    ],
)
def test_check_fails_with_a_diff_when_output_was_touched(project: Path, spoil: object, shown: str) -> None:
    codra("compile", "specs", cwd=project)
    assert callable(spoil)
    spoil(project / "generated")

    process = codra("compile", "specs", "--check", cwd=project)

    assert process.returncode == 1
    assert shown in process.stdout
    assert codra("compile", "specs", cwd=project).returncode == 0
    assert codra("compile", "specs", "--check", cwd=project).returncode == 0


def test_drift_as_json_is_a_finding_for_every_file(project: Path) -> None:
    codra("compile", "specs", cwd=project)
    (project / "generated/door/door.py").write_text("x = 1\n")

    process = codra("compile", "specs", "--check", "--format", "json", cwd=project)

    (finding,) = map(json.loads, process.stdout.splitlines())
    assert (finding["code"], finding["file"]) == ("CDR6003", "generated/door/door.py")


def test_a_folder_that_is_not_ours_is_refused_with_a_finding(project: Path) -> None:
    (project / "src").mkdir()
    (project / "src/robot.py").write_text("x = 1\n")

    process = codra("compile", "specs", "--out", "src", cwd=project)

    assert process.returncode == 1
    assert process.stdout.startswith("src:1:1: error[CDR6002]: 'src' holds files that codra did not make")
    assert [path.name for path in (project / "src").iterdir()] == ["robot.py"]


# graph


def test_graph_prints_the_same_graph_in_every_format() -> None:
    as_json = json.loads(codra("graph", "specs/lab.yaml", "--format", "json", cwd=ROOT).stdout)
    as_dot = pygraphviz.AGraph(string=codra("graph", "specs/lab.yaml", "--all", cwd=ROOT).stdout)

    assert {str(node) for node in as_dot.nodes()} == {node["id"] for node in as_json["nodes"]}
    assert len(as_dot.edges()) == len(as_json["edges"])


def test_graph_draws_into_a_file(project: Path) -> None:
    process = codra("graph", "specs", "--format", "svg", "--output", "door.svg", cwd=project)

    assert (process.returncode, process.stdout) == (0, "")
    assert "door_open" in (project / "door.svg").read_text()


def test_graph_reports_findings_on_standard_error(project: Path) -> None:
    (project / "specs/door.yaml").write_text(MISSPELT)

    process = codra("graph", "specs", cwd=project)

    assert (process.returncode, process.stdout, process.stderr) == (1, "", f"{MONITER}1 error\n")


# Places


def test_the_project_of_a_path_is_that_of_its_last_folder(project: Path) -> None:
    """The path `inner/../specs` does not depend on `inner`, even if `inner` is a project."""
    (project / "inner").mkdir()
    (project / "inner/pyproject.toml").write_text("[tool.codra]\n")
    (project / "specs/door.yaml").write_text(MISSPELT)

    process = codra("lint", "inner/../specs", "specs/door.yaml", cwd=project)

    assert (process.returncode, process.stdout) == (1, MONITER)
    assert codra("lint", "../specs", cwd=project / "inner").stdout == MONITER


def test_a_parent_of_a_link_is_resolved_as_by_the_file_system(project: Path, tmp_path: Path) -> None:
    (project / "specs/door.yaml").write_text(MISSPELT)
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "link").symlink_to(project / "specs")

    assert codra("lint", "link/../specs", cwd=outside).stdout == MONITER


def test_a_pipe_instead_of_settings_does_not_block(project: Path) -> None:
    (project / "pyproject.toml").unlink()
    os.mkfifo(project / "pyproject.toml")

    assert codra("lint", "specs", cwd=project).returncode == 0


@pytest.mark.parametrize("output", [".", "nowhere/findings.txt"])
def test_if_the_result_cannot_be_written_the_command_does_not_run(project: Path, output: str) -> None:
    process = codra("compile", "specs", "--output", output, cwd=project)

    assert (process.returncode, process.stdout) == (2, "")
    assert not (project / "generated").exists()


# Endings


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_closed_pipe_causes_no_error_message(project: Path, unbuffered: str) -> None:
    """The output is larger than the pipe's buffer, and the reader takes one byte."""
    names = [f"measured_{number}" for number in range(200)]
    context = "".join(f"  {name}: {{type: bool, source: main_execution}}\n" for name in names)
    (project / "specs/door.yaml").write_text(DOOR.replace("perception:", f"{context}perception:"))

    with subprocess.Popen(
        [sys.executable, "-m", "codra_dsl", "lint", "specs"],
        cwd=project,
        env=environment(PYTHONUNBUFFERED=unbuffered),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        pipesize=4096,
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        os.read(process.stdout.fileno(), 1)
        process.stdout.close()
        noise = process.stderr.read()

    assert (process.returncode, noise) == (1, b"")


def _restore_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def test_interruption_ends_with_130(project: Path) -> None:
    """The input is larger than the pipe's buffer, so the command is still reading when it is interrupted."""
    with subprocess.Popen(
        [sys.executable, "-m", "codra_dsl", "lint", "-"],
        cwd=project,
        env=environment(),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        preexec_fn=_restore_interrupts,  # a shell makes background jobs ignore them  # noqa: PLW1509
    ) as process:
        assert process.stdin is not None
        process.stdin.write(b"# waiting\n" * 50_000)
        process.stdin.flush()
        while process.poll() is None:  # a signal just before a read begins does not interrupt that read
            process.send_signal(signal.SIGINT)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(timeout=2)

        assert process.returncode == 130
        assert process.stderr is not None
        assert b"Traceback" not in process.stderr.read()


def interrupt(process: subprocess.Popen[bytes]) -> None:
    """Send SIGINT, as Ctrl-C does, until the process ends. Between two reads, Python notices it only after the next."""
    while process.returncode is None:
        process.send_signal(signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(2)


BROKEN_INSIDE = """
import codra_dsl.compiler as pipeline
def check(*arguments): raise KeyError("door_open")
pipeline.check = check
import sys
from codra_dsl.cli import main
sys.argv = ["codra", "lint", "specs"]
main()
"""


@pytest.mark.parametrize("arguments", [["--help"], ["lint", "--help"], ["explain"]])
def test_a_full_disk_is_not_reported_as_a_bug(arguments: list[str]) -> None:
    with Path("/dev/full").open("w") as full:
        process = subprocess.run(
            [sys.executable, "-m", "codra_dsl", *arguments],
            env=environment(),
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )

    assert process.returncode == 1
    assert process.stderr.startswith("codra: cannot write")
    assert process.stderr.endswith(": No space left on device\n")


def test_an_internal_error_is_reported_as_a_bug_and_exits_with_70(project: Path) -> None:
    process = as_text(run_python(("-c", BROKEN_INSIDE), project, environment()))

    assert (process.returncode, process.stdout) == (70, "")
    assert process.stderr.startswith("codra: internal error: KeyError: 'door_open' (codra_dsl/compiler.py:")
    assert "Traceback" not in process.stderr


def test_a_terminal_without_unicode_still_gets_its_findings(project: Path) -> None:
    (project / "specs/door.yaml").write_text(MISSPELT.replace("moniter", "möniter"), "utf-8")

    process = codra("lint", "specs", cwd=project, PYTHONIOENCODING="ascii")

    assert process.returncode == 1
    assert "m\\xf6niter" in process.stdout


def test_a_full_device_or_a_closed_standard_output_ends_without_a_traceback(project: Path) -> None:
    for redirection, code in ((">/dev/full", 1), (">&-", 0)):
        command = f"{shlex.quote(sys.executable)} -m codra_dsl graph specs {redirection}"
        process = subprocess.run(
            ["/bin/sh", "-c", command], cwd=project, env=environment(), text=True, capture_output=True, check=False
        )

        assert (process.returncode, "Traceback" in process.stderr, "internal" in process.stderr) == (code, False, False)
