"""Write the results of an experiment into its folder: an HTML page for people, and JSON.

Values that differ from run to run, such as how long a run took, are only on the page, never in `results.json`.
"""

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
    """Write the page and the data into a folder and return their paths.

    Both files are first written to a temporary folder. If a file cannot be written there, the existing files of an
    earlier report stay unchanged.

    Raises:
        OSError: if a file cannot be written.
        ValueError: if the results contain values that JSON cannot represent, such as NaN.
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
    """Return the results as JSON in the form of `results.schema.json`, without values that differ from run to run.

    Raises:
        ValueError: if the results contain values that JSON cannot represent, such as NaN.
    """
    revision = provenance.revision
    content = {
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
            name: {
                "seed": outcome.seed,
                "duration_s": outcome.duration_s,
                "loops": outcome.loops,
                "error": outcome.error,
            }
            for name, outcome in outcomes.items()
        },
        "results": document.results,
    }
    return json.dumps(content, indent=2, allow_nan=False) + "\n"
