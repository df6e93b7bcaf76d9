"""What stands at the head of a journal: which spec ran, with what seed, by which versions."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from codra_dsl import __version__
from codra_dsl.runtime.outline import Outline

FORMAT = "codra-journal"
FORMAT_VERSION = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Head:
    """What runs.

    Attributes:
        spec: the name of the spec.
        file: the spec's file, relative to its project; empty if the model was put together by hand.
        model: the digest of what the spec means, as in `manifest.json`; empty likewise.
        seed: of the chance that jobs see.
        start_s: what the clock showed.
        outline: what the spec says.
        codra: the version that ran it.
        python: likewise.
    """

    spec: str
    file: str
    model: str
    seed: int
    start_s: float
    outline: Outline
    codra: str = __version__
    python: str = ".".join(map(str, sys.version_info[:3]))

    @classmethod
    def of_run(cls, outline: Outline, manifest: Mapping[str, Any], *, seed: int, start_s: float) -> Self:
        """Return the head of a run that begins, given what the manifest of its package says."""
        file, model = str(manifest.get("spec", "")), str(manifest.get("model", ""))
        return cls(spec=outline.name, file=file, model=model, seed=seed, start_s=start_s, outline=outline)

    def plain(self) -> dict[str, Any]:
        """Return all but the outline as plain data."""
        return {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "spec": self.spec,
            "file": self.file,
            "model": self.model,
            "seed": self.seed,
            "start_s": self.start_s,
            "codra": self.codra,
            "python": self.python,
        }

    @classmethod
    def of(cls, plain: Mapping[str, Any], outline: Outline) -> Self:
        """Return the head that plain data tells."""
        return cls(
            spec=str(plain["spec"]),
            file=str(plain["file"]),
            model=str(plain["model"]),
            seed=int(plain["seed"]),
            start_s=float(plain["start_s"]),
            outline=outline,
            codra=str(plain["codra"]),
            python=str(plain["python"]),
        )
