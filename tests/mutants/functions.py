"""The perception functions that a spec calls: ours where they are ours, else such that take what the spec gives."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

from codra_dsl.load import load_spec
from codra_dsl.model import Access, Algorithm
from tests.mutants.mutation import ROOT, laid_out


def perception_of(files: Mapping[str, str]) -> dict[str, str]:
    """Return the modules that a valid project calls, with those of the packages around them, by path."""
    found: dict[str, str] = {}
    for algorithm in _algorithms(files):
        module, _, function = algorithm.call.partition(":")
        path = Path(*module.split(".")).with_suffix(".py")
        for folder in path.parents[:-1]:
            found[f"{folder.as_posix()}/__init__.py"] = ""
        if (ROOT / path).is_file():
            found[path.as_posix()] = (ROOT / path).read_text("utf-8")
        else:
            taken = ", ".join(dict.fromkeys((*_arguments(algorithm), "job")))
            before = found.setdefault(path.as_posix(), "")
            if f"def {function}(" not in before:
                found[path.as_posix()] = f"{before}def {function}(*, {taken}):\n    raise NotImplementedError\n"
    return found


def _algorithms(files: Mapping[str, str]) -> tuple[Algorithm, ...]:
    with tempfile.TemporaryDirectory() as name:
        spec, _ = load_spec(laid_out(files, Path(name)), Path(name))
        return () if spec is None else spec.perception


def _arguments(algorithm: Algorithm) -> Iterator[str]:
    yield from (name for name, _ in algorithm.parameters)
    yield from (usage.resource.name for usage in algorithm.uses if usage.access is Access.READ)
    yield from (reference.name for reference in algorithm.given)
