"""The perception functions that a spec calls: those of this repository, else stubs that take the spec's arguments."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

from codra_dsl.language.load import load_spec
from codra_dsl.language.model import Access, Algorithm
from tests.campaigns.mutants.mutation import ROOT, laid_out


def perception_of(files: Mapping[str, str]) -> dict[str, str]:
    """Return the modules that a valid project calls, with their packages, by path."""
    sources: dict[str, str] = {}
    for algorithm in _algorithms(files):
        module, _, function = algorithm.call.partition(":")
        path = Path(*module.split(".")).with_suffix(".py")
        for folder in path.parents[:-1]:
            sources[f"{folder.as_posix()}/__init__.py"] = ""
        if (ROOT / path).is_file():
            sources[path.as_posix()] = (ROOT / path).read_text("utf-8")
        else:
            taken = ", ".join(dict.fromkeys((*_arguments(algorithm), "job")))
            before = sources.setdefault(path.as_posix(), "")
            if f"def {function}(" not in before:
                sources[path.as_posix()] = f"{before}def {function}(*, {taken}):\n    raise NotImplementedError\n"
    return sources


def _algorithms(files: Mapping[str, str]) -> tuple[Algorithm, ...]:
    with tempfile.TemporaryDirectory() as name:
        spec, _ = load_spec(laid_out(files, Path(name)), Path(name))
        return () if spec is None else spec.perception


def _arguments(algorithm: Algorithm) -> Iterator[str]:
    yield from (name for name, _ in algorithm.parameters)
    yield from (usage.resource.name for usage in algorithm.uses if usage.access is Access.READ)
    yield from (reference.name for reference in algorithm.given)
