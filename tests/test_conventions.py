"""The conventions that no single package can check: layers, sizes, packaging, and tests that all run.

The structure of the code base is tested like its behaviour.
"""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import distribution
from pathlib import Path

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[1]
COMPILER_LIBRARIES = ("yaml", "jsonschema", "jsonschema_rs", "jinja2", "networkx", "typer", "rich")
LONGEST_FUNCTION_LINES = 70
LONGEST_FILE_LINES = 500
MAX_MODULES = 20

IMPORT_THE_RUNTIME = """
import importlib, pkgutil, sys
for name in sys.argv[1:]:
    sys.modules[name] = None
import codra_dsl.runtime, generated
for package in (codra_dsl.runtime, generated):
    for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        importlib.import_module(module.name)
"""


def run(*command: str | Path, cwd: Path = ROOT, env: Mapping[str, str] | None = None) -> str:
    """Run a command, assert that it succeeds, and return its output."""
    process = subprocess.run(
        command, cwd=cwd, env=env, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False
    )
    assert process.returncode == 0, process.stdout
    return process.stdout


def sources(folder: str) -> dict[str, str]:
    texts = {str(path.relative_to(ROOT)): path.read_text("utf-8") for path in sorted((ROOT / folder).rglob("*.py"))}
    assert texts
    return texts


def nodes(folder: str, words: Iterable[str] = ("",)) -> Iterator[tuple[str, ast.AST]]:
    """Yield the nodes of the files of a folder that contain one of these words."""
    for path, text in sources(folder).items():
        if any(word in text for word in words):
            for node in ast.walk(ast.parse(text)):
                yield path, node


# Layers


def test_every_layer_imports_only_lower_layers() -> None:
    output = run(Path(sys.executable).with_name("lint-imports"))
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]["contracts"]

    assert f"Contracts: {len(contracts)} kept, 0 broken." in output


def test_the_runtime_and_generated_code_import_without_the_libraries_of_the_compiler() -> None:
    run(sys.executable, "-c", IMPORT_THE_RUNTIME, *COMPILER_LIBRARIES)


def imported_names(node: ast.AST) -> list[str]:
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if isinstance(node, ast.ImportFrom) and not node.level:
        return [node.module or ""]
    return []


def test_generated_code_imports_only_py_trees_and_one_module_of_codra() -> None:
    allowed_pattern = re.compile(r"py_trees(\..+)?|codra_dsl\.runtime\.generated_api")
    foreign_imports = [
        f"{path} imports {name}"
        for path, node in nodes("generated")
        for name in imported_names(node)
        if name.split(".")[0] not in sys.stdlib_module_names and not allowed_pattern.fullmatch(name)
    ]

    assert foreign_imports == []


# Sizes


@pytest.mark.parametrize("folder", ["codra_dsl", "codra_papers", "generated", "tests"])
def test_no_function_is_longer_than_a_screen(folder: str) -> None:
    lengths = {
        f"{path}:{node.lineno} {node.name}": (node.end_lineno or node.lineno) - node.lineno + 1
        for path, node in nodes(folder)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    }

    assert {name: length for name, length in lengths.items() if length > LONGEST_FUNCTION_LINES} == {}


@pytest.mark.parametrize("folder", ["codra_dsl", "codra_papers"])
def test_no_file_is_too_long_to_survey(folder: str) -> None:
    lengths = {path: text.count("\n") for path, text in sources(folder).items()}

    assert {path: length for path, length in lengths.items() if length > LONGEST_FILE_LINES} == {}


def test_no_folder_of_the_papers_has_more_than_20_modules() -> None:
    module_counts = Counter(str(Path(path).parent) for path in sources("codra_papers"))

    assert {folder: count for folder, count in module_counts.items() if count > MAX_MODULES} == {}


# Tests


def test_every_test_runs_and_none_is_allowed_to_fail() -> None:
    """No test is skipped or expected to fail, by a mark, a call, an exception or a name of unittest's."""
    escape_names = {"skip", "skipif", "xfail", "importorskip", "skipTest", "skipIf", "skipUnless", "SkipTest"}
    escape_names |= {"expectedFailure", "collect_ignore", "collect_ignore_glob", "__test__"}
    violations = [
        f"{path}:{node.lineno} {name}"
        for path, node in nodes("tests", escape_names)
        for name in [getattr(node, "attr", None) or getattr(node, "id", None)]
        if isinstance(node, ast.Attribute | ast.Name) and name in escape_names
    ]

    assert violations == []


# Packaging


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_wheel(ROOT, tmp_path_factory.mktemp("wheel"))


def build_wheel(project: Path, folder: Path) -> Path:
    """Build the wheel of a project into a folder."""
    run(sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", folder, project)
    (wheel,) = folder.glob("*.whl")
    return wheel


def files_in_wheel(wheel: Path) -> set[str]:
    return {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}


def files_in_repository(package: str) -> set[str]:
    """The files of a package in the repository."""
    return {
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / package).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }


def test_the_wheel_has_only_the_package(wheel: Path) -> None:
    """The wheel has every file of the package in the repository, and no specs, tests, worlds or generated code."""
    packed_files = files_in_wheel(wheel)

    assert packed_files == files_in_repository("codra_dsl")
    assert {"codra_dsl/schema.json", "codra_dsl/py.typed"} <= packed_files
    remote_files = {"codra_dsl/runtime/remote/messages.schema.json", "codra_dsl/runtime/remote/include/codra.hpp"}
    assert remote_files <= packed_files
    assert any(re.fullmatch(r"codra_dsl/generation/emit/.*\.(j2|jinja)", name) for name in packed_files)


def test_the_wheel_of_the_papers_holds_their_package_and_its_entry_points(tmp_path: Path) -> None:
    papers_wheel = build_wheel(ROOT / "codra_papers", tmp_path)
    file_names = zipfile.ZipFile(papers_wheel).namelist()
    (entry_points,) = (name for name in file_names if name.endswith("/entry_points.txt"))
    entry_points_text = zipfile.ZipFile(papers_wheel).read(entry_points).decode()

    build_files = {"codra_papers/hatch_build.py", "codra_papers/pyproject.toml"}
    assert files_in_wheel(papers_wheel) == files_in_repository("codra_papers") - build_files
    assert "[codra.worlds]\nlab = codra_papers.cli.lab:lab\nstore = codra_papers.cli.store:store\n" in entry_points_text
    assert "[codra.commands]\nexperiment = codra_papers.cli.experiment:experiment_command\n" in entry_points_text


def test_the_wheel_needs_no_library_of_a_simulator(wheel: Path) -> None:
    metadata = next(name for name in zipfile.ZipFile(wheel).namelist() if name.endswith("/METADATA"))
    required_names = re.findall(
        r"^Requires-Dist: ([\w-]+)", zipfile.ZipFile(wheel).read(metadata).decode(), re.MULTILINE
    )

    assert {"mujoco", "opencv-python-headless", "starlette", "uvicorn"}.isdisjoint(required_names)


@pytest.fixture(scope="module")
def site(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the unpacked wheel and the distributions that it requires without extras."""
    folder = tmp_path_factory.mktemp("site")
    run(sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--target", folder, wheel)
    metadata = next(folder.glob("codra_dsl-*.dist-info/METADATA")).read_text("utf-8")
    pending_names = applicable_names(re.findall(r"^Requires-Dist: (.*)$", metadata, re.MULTILINE))
    linked_names = set[str]()
    while pending_names:
        name = pending_names.pop()
        if name not in linked_names:
            linked_names.add(name)
            link_distribution(name, folder)
            pending_names += applicable_names(distribution(name).requires or [])
    return folder


def applicable_names(requirement_lines: list[str]) -> list[str]:
    """Return the names of the requirements that apply here without an extra."""
    requirements = [Requirement(line) for line in requirement_lines]
    return [
        requirement.name
        for requirement in requirements
        if requirement.marker is None or requirement.marker.evaluate({"extra": ""})
    ]


def link_distribution(name: str, folder: Path) -> None:
    installed_distribution = distribution(name)
    for top_name in sorted({path.parts[0] for path in installed_distribution.files or []} - {"..", "__pycache__"}):
        if not (folder / top_name).exists():
            (folder / top_name).symlink_to(str(installed_distribution.locate_file(top_name)))


def test_an_installed_wheel_compiles_a_spec_outside_the_repository(site: Path, tmp_path: Path) -> None:
    """The spec is the one in README.md."""
    (spec,) = re.findall(
        r"^```yaml[^\n]*\n(.*?)^```", (ROOT / "README.md").read_text("utf-8"), re.MULTILINE | re.DOTALL
    )
    (tmp_path / "door.yaml").write_text(spec, "utf-8")
    python = (sys.executable, "-S", "-B")  # -S: without the packages that are installed beside `site`
    env = {"PYTHONPATH": str(site), "PATH": os.environ["PATH"]}

    run(*python, "-m", "codra_dsl", "compile", "door.yaml", "--out", "generated", cwd=tmp_path, env=env)
    run(*python, "-m", "codra_dsl", "compile", "door.yaml", "--out", "generated", "--check", cwd=tmp_path, env=env)
    printed = run(*python, "-c", "import generated.door as d; print(d.__file__)", cwd=tmp_path, env=env)

    assert printed.strip() == str(tmp_path / "generated/door/__init__.py")


def test_the_wheel_installs_the_command(wheel: Path) -> None:
    entry_points = next(name for name in zipfile.ZipFile(wheel).namelist() if name.endswith("/entry_points.txt"))

    assert "codra = codra_dsl.cli:main" in zipfile.ZipFile(wheel).read(entry_points).decode()
