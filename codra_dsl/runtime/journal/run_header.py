"""The run header of a journal: the spec that ran, its seed, and the versions of codra and Python."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Self

import codra_dsl
from codra_dsl.runtime.journal.fields import JsonSchema, field_schema
from codra_dsl.runtime.journal.spec_summary import SpecSummary

FORMAT = "codra-journal"
FORMAT_VERSION = 1
RUN_TOPIC = "/codra/run"


@dataclass(frozen=True, slots=True, kw_only=True)
class RunHeader:
    """The description of a run.

    Attributes:
        spec: the name of the spec.
        file: the spec's file, relative to its project; empty if the model was built by hand.
        model: the digest of the spec's content, as in `manifest.json`; empty if the model was built by hand.
        seed: the seed of the random numbers that jobs draw.
        start_s: the time on the run's clock at the start.
        summary: the spec summary.
        codra: the version of codra that ran the spec.
        python: the version of Python that ran the spec.
    """

    spec: str
    file: str
    model: str
    seed: int
    start_s: float
    summary: SpecSummary
    codra: str = field(default_factory=lambda: codra_dsl.__version__)
    python: str = ".".join(map(str, sys.version_info[:3]))

    @classmethod
    def of_run(cls, summary: SpecSummary, manifest: Mapping[str, Any], *, seed: int, start_s: float) -> Self:
        """Return the header of a run that begins; `manifest` is the manifest of the generated package."""
        file, model = str(manifest.get("spec", "")), str(manifest.get("model", ""))
        return cls(spec=summary.name, file=file, model=model, seed=seed, start_s=start_s, summary=summary)

    def to_data(self) -> dict[str, Any]:
        """Return everything except the spec summary as plain data."""
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
    def from_data(cls, data: Mapping[str, Any], summary: SpecSummary) -> Self:
        """Return the header that `to_data()` and a spec summary describe."""
        return cls(
            spec=str(data["spec"]),
            file=str(data["file"]),
            model=str(data["model"]),
            seed=int(data["seed"]),
            start_s=float(data["start_s"]),
            summary=summary,
            codra=str(data["codra"]),
            python=str(data["python"]),
        )


def run_schema() -> tuple[str, JsonSchema]:
    """Return the schema of the message that describes the run."""
    fields = {
        "format": field_schema("string", "The format of the file."),
        "format_version": field_schema("integer", "The version of the format."),
        "spec": field_schema("string", "The name of the spec."),
        "file": field_schema("string", "The spec's file, relative to its project; empty if there is none."),
        "model": field_schema("string", "A digest of the spec's content, as in manifest.json; empty if there is none."),
        "seed": field_schema("integer", "The seed of the random numbers that perception functions draw."),
        "start_s": field_schema("number", "The time on the run's clock at the start."),
        "codra": field_schema("string", "The version of codra that ran the spec."),
        "python": field_schema("string", "The version of Python that ran the spec."),
    }
    return "codra.Run", {
        "type": "object",
        "description": "The spec that runs, its seed, and the versions of codra and Python.",
        "properties": fields,
        "required": list(fields),
        "additionalProperties": False,
    }
