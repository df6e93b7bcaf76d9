"""Output folders that other programs change while they are written."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from codra_dsl.compiler import compile_paths
from codra_dsl.generation.output import freshness, write
from tests.test_compiler import DOOR


def test_a_package_that_another_run_removes_meanwhile_is_no_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "pyproject.toml").write_text("[tool.codra]\n")
    (tmp_path / "door.yaml").write_text(DOOR)
    (tmp_path / "gate.yaml").write_text(DOOR.replace("name: door", "name: gate"))
    both = compile_paths([tmp_path], tmp_path)
    out = tmp_path / "generated"
    assert write(both.files, out, both.covered).diagnostics == ()
    (tmp_path / "gate.yaml").unlink()
    door = compile_paths([tmp_path], tmp_path)
    unlink = Path.unlink

    def unlink_after_other_run(path: Path, *, missing_ok: bool = False) -> None:
        if path.parent == out / "gate":
            shutil.rmtree(out / "gate", ignore_errors=True)
        unlink(path, missing_ok=missing_ok)

    monkeypatch.setattr(Path, "unlink", unlink_after_other_run)

    assert write(door.files, out, door.covered).diagnostics == ()
    assert freshness(door.files, out, door.covered).drifts == ()
    assert not (out / "gate").exists()
