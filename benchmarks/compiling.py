"""The rows about compiling: a whole process, from specs on disk to packages on disk, beside reading the same YAML."""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Iterator, Mapping
from itertools import count
from pathlib import Path

from forests import expanded, flat, flat_specs, templated, write
from processes import Cost, in_turns, run
from rows import Row

RUNS = 5
SMALL_VARIABLE_COUNT, LARGE_VARIABLE_COUNT = 10_000, 50_000
MEMORY_BYTES = 10**9
EDITED_FILE_COUNT = 100
EDITED_CHAINS_PER_FILE = 8

_ANGLE = re.compile(r"angle > 0\.[0-9]+ rad")

_HERE = Path(__file__).parent
_PEER_COMMAND = (sys.executable, _HERE / "yaml_load.py", ".")


def rows(scratch: Path) -> Iterator[Row]:
    """Yield the rows, measured in a scratch folder."""
    small, large = (
        _project(scratch / "flat", flat(SMALL_VARIABLE_COUNT)),
        _project(scratch / "large", flat(LARGE_VARIABLE_COUNT)),
    )
    yield from _cold_and_warm("compile", small, small)
    yield from _templated(scratch)
    small_cost, large_cost = in_turns(
        RUNS, lambda: _compile_without_cache(small), lambda: _compile_without_cache(large)
    )
    yield Row(name="compile_growth", ours=large_cost.wall_s, peer=small_cost.wall_s, target=5.5)
    yield Row(name="compile_memory", ours=float(large_cost.peak_bytes), peer=float(MEMORY_BYTES), target=1.0)
    specs = _project(scratch / "specs", flat_specs(SMALL_VARIABLE_COUNT, EDITED_FILE_COUNT))
    parts = _project(scratch / "parts", flat(SMALL_VARIABLE_COUNT, EDITED_CHAINS_PER_FILE))
    yield _edited("edit_one_line", specs, "hall_050.yaml")
    yield _edited("edit_one_line_of_a_part", parts, "parts/flat_00400.yaml")


def _templated(scratch: Path) -> Iterator[Row]:
    """Yield the rows of a spec with a template: the peer reads the same declarations without a template.

    The peer does not expand templates, so it gets the text that an author without templates writes. Both sides have
    the same observers.
    """
    project = _project(scratch / "templated", templated(SMALL_VARIABLE_COUNT))
    yield from _cold_and_warm(
        "compile_templated", project, _project(scratch / "expanded", expanded(SMALL_VARIABLE_COUNT))
    )


def _cold_and_warm(name: str, project: Path, peer_project: Path) -> Iterator[Row]:
    cold, peer = in_turns(RUNS, lambda: _compile_without_cache(project), lambda: run(_PEER_COMMAND, peer_project))
    yield Row(name=f"{name}_cold", ours=cold.wall_s, peer=peer.wall_s, target=2.0)
    _compile(project)
    (warm,) = in_turns(RUNS, lambda: _compile(project))
    yield Row(name=f"{name}_warm", ours=warm.wall_s, peer=cold.wall_s, target=0.1)
    _require_that_an_edit_is_noticed(project)


def _edited(name: str, project: Path, file: str) -> Row:
    """Measure a compilation after one line of one file was changed since the last one, beside reading all files."""
    numbers = count(15)

    def compile_after_edit() -> Cost:
        text = (project / file).read_text("utf-8")
        (project / file).write_text(_ANGLE.sub(f"angle > 0.{next(numbers)} rad", text, count=1), "utf-8")
        return _compile(project)

    _compile(project)
    edited, peer = in_turns(RUNS, compile_after_edit, lambda: run(_PEER_COMMAND, project))
    return Row(name=name, ours=edited.wall_s, peer=peer.wall_s, target=0.3)


def _project(folder: Path, files: Mapping[str, str]) -> Path:
    write(files, folder)
    return folder


def _compile_without_cache(project: Path) -> Cost:
    """Compile without any results of earlier runs."""
    shutil.rmtree(project / "generated", ignore_errors=True)
    return _compile(project, "--no-cache")


def _compile(project: Path, *options: str) -> Cost:
    return run((sys.executable, "-m", "codra_dsl", "compile", ".", *options), project)


def _require_that_an_edit_is_noticed(project: Path) -> None:
    """Require that an edited output is renewed even if no spec has changed; otherwise the speed is worthless."""
    edited_file = next((project / "generated").rglob("graph.json"))
    original_bytes = edited_file.read_bytes()
    edited_file.write_bytes(original_bytes + b"\n")
    _compile(project)
    if edited_file.read_bytes() != original_bytes:
        raise RuntimeError(f"{edited_file} was edited and is not renewed")
