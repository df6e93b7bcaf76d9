"""What an experiment leaves in its folder: a page for people and the same as data."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from codra_papers.experiments.campaign.document import Document
from codra_papers.experiments.campaign.experiment import AnyOutcome, Experiment
from codra_papers.experiments.campaign.page import render_page
from codra_papers.experiments.campaign.provenance import Provenance

PAGE = "report.html"
DATA = "results.json"
_VERSION = 1


def write_results(
    folder: Path,
    experiment: Experiment,
    document: Document,
    outcomes: Mapping[str, AnyOutcome],
    provenance: Provenance,
) -> Sequence[Path]:
    """Write the page and the data into a folder, both or neither changed; return their paths.

    Raises:
        OSError: if that is not possible.
        ValueError: if the results hold what JSON cannot, such as a number that is none.
    """
    texts = {
        folder / PAGE: render_page(experiment, document, outcomes, provenance),
        folder / DATA: as_json(experiment, document, outcomes, provenance),
    }
    with tempfile.TemporaryDirectory(prefix=".codra-", dir=folder) as staging:
        for path, text in texts.items():
            (Path(staging) / path.name).write_text(text, encoding="utf-8")
        for path in texts:
            (Path(staging) / path.name).replace(path)
    return list(texts)


def as_json(
    experiment: Experiment, document: Document, outcomes: Mapping[str, AnyOutcome], provenance: Provenance
) -> str:
    """Return the results as JSON in the form of `results.schema.json`, without anything that differs from run to run.

    Raises:
        ValueError: if the results hold what JSON cannot, such as a number that is none.
    """
    revision = provenance.revision
    told = {
        "version": _VERSION,
        "experiment": experiment.name,
        "question": experiment.question,
        "command": provenance.command,
        "spec": provenance.spec,
        "versions": dict(provenance.versions),
        "code": provenance.code,
        "revision": None if revision is None else {"commit": revision.commit, "is_clean": revision.is_clean},
        "seeds": list(provenance.seeds),
        "trials": {
            name: {"seed": each.seed, "duration_s": each.duration_s, "loops": each.loops, "error": each.error}
            for name, each in outcomes.items()
        },
        "results": document.results,
    }
    return json.dumps(told, indent=2, allow_nan=False) + "\n"
