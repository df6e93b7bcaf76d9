"""The rows about compiling: a whole process, from specs on disk to packages on disk, beside reading the same YAML."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

from forests import flat, templated, write
from processes import Cost, in_turns, run
from rows import Row

RUNS = 5
SMALL, LARGE = 10_000, 50_000
MEMORY_BYTES = 10**9

_HERE = Path(__file__).parent
_PEER = (sys.executable, _HERE / "yaml_load.py", ".")


def rows(scratch: Path) -> Iterator[Row]:
    """Yield the rows, measured in a scratch folder."""
    small, large = _project(scratch / "flat", flat(SMALL)), _project(scratch / "large", flat(LARGE))
    yield from _cold_and_warm("compile", small)
    yield from _cold_and_warm("compile_templated", _project(scratch / "templated", templated(SMALL)))
    few, many = in_turns(RUNS, lambda: _cold(small), lambda: _cold(large))
    yield Row(name="compile_growth", ours=many.wall_s, peer=few.wall_s, target=5.5)
    yield Row(name="compile_memory", ours=float(many.peak_bytes), peer=float(MEMORY_BYTES), target=1.0)


def _cold_and_warm(name: str, project: Path) -> Iterator[Row]:
    cold, peer = in_turns(RUNS, lambda: _cold(project), lambda: run(_PEER, project))
    yield Row(name=f"{name}_cold", ours=cold.wall_s, peer=peer.wall_s, target=1.0)
    _compile(project)
    (warm,) = in_turns(RUNS, lambda: _compile(project))
    yield Row(name=f"{name}_warm", ours=warm.wall_s, peer=cold.wall_s, target=0.1)
    _require_that_an_edit_is_noticed(project)


def _project(folder: Path, files: Mapping[str, str]) -> Path:
    write(files, folder)
    return folder


def _cold(project: Path) -> Cost:
    """Compile without any results of earlier runs."""
    shutil.rmtree(project / "generated", ignore_errors=True)
    return _compile(project, "--no-cache")


def _compile(project: Path, *options: str) -> Cost:
    return run((sys.executable, "-m", "codra_dsl", "compile", ".", *options), project)


def _require_that_an_edit_is_noticed(project: Path) -> None:
    """Require that an edited output is renewed although no spec has changed; otherwise the speed would be worthless."""
    edited = next((project / "generated").rglob("graph.json"))
    before = edited.read_bytes()
    edited.write_bytes(before + b"\n")
    _compile(project)
    if edited.read_bytes() != before:
        raise RuntimeError(f"{edited} was edited and is not renewed")
