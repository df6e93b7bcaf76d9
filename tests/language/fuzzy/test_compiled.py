"""Compiled modules of any engine pass the same checks as other code of this project."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from codra_dsl.language.fuzzy import compile_engine
from codra_dsl.language.project import GENERATED_API
from tests.language.fuzzy.engines import NAMES, engine_of, loaded, stored
from tests.language.fuzzy.test_reading import GOOD
from tests.type_checker import run_mypy

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def modules(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("compiled")
    for name in NAMES:
        (folder / f"{name}.py").write_text(compile_engine(stored(name)), "utf-8")
    return folder


def run(*command: str | Path) -> None:
    done = subprocess.run(
        command,
        cwd=ROOT,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        stdin=subprocess.DEVNULL,
        check=False,
    )
    assert done.returncode == 0, done.stdout


def test_compiled_modules_pass_the_linter(modules: Path) -> None:
    ruff = Path(sys.executable).with_name("ruff")
    for name in NAMES:
        text = (modules / f"{name}.py").read_text("utf-8")
        done = subprocess.run(
            (ruff, "check", "--stdin-filename", f"generated/{name}.py", "-"),
            cwd=ROOT,
            input=text,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            check=False,
        )
        assert done.returncode == 0, done.stdout


def test_compiled_modules_have_types(modules: Path) -> None:
    done = run_mypy(str(modules))
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("name", NAMES)
def test_compiled_modules_import_only_the_runtime_and_compute_only_when_called(name: str) -> None:
    tree = ast.parse(compile_engine(stored(name)))
    imported = {
        getattr(node, "module", None) or node.names[0].name
        for node in ast.walk(tree)
        if isinstance(node, ast.Import | ast.ImportFrom)
    }
    called = {
        ast.unparse(node.value.func)
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Call)
    }

    assert imported <= {"__future__", "math", GENERATED_API}
    assert called <= {"outputs.Integral", "outputs.Weighted"}


def test_texts_of_an_engine_cannot_break_out_of_their_literals() -> None:
    text = GOOD.replace("Engine: fan", "Engine: \\\"\"\"; raise SystemExit('''").replace(
        "RuleBlock: only", "RuleBlock: '''\"\"\""
    )

    assert loaded(engine_of(text)).infer(0.9).values[0] == pytest.approx(8.0)
