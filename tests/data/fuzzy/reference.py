"""Writes values.npz, what FuzzyLite makes of each engine for each row of `samples`, and constructs.json, its words.

It runs in an environment of its own, since pyfuzzylite is GPL and needs an old numpy; we only keep its answers:

    make .venv-fuzzylite/.ready
    .venv-fuzzylite/bin/python tests/data/fuzzy/reference.py

Values are stored in single precision, which is right to 6e-8 of a value, and infinite or NaN as they are.
"""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import fuzzylite
import numpy as np
import samples

FOLDER = Path(__file__).parent


def answers(engine: fuzzylite.Engine) -> np.ndarray:
    """Ask an engine with row after row, one at a time; what it keeps of the row before counts."""
    ranges = [(float(each.minimum), float(each.maximum)) for each in engine.input_variables]
    found = []
    for row in samples.rows(engine.name, ranges):
        for variable, value in zip(engine.input_variables, row, strict=True):
            variable.value = value
        engine.process()
        found.append([float(np.asarray(each.value).ravel()[0]) for each in engine.output_variables])
    return np.array(found)


def constructs() -> dict[str, list[str]]:
    """Return the words that FuzzyLite knows in FLL."""
    known = fuzzylite.settings.factory_manager
    factories = {
        "term": known.term,
        "T-norm": known.tnorm,
        "S-norm": known.snorm,
        "hedge": known.hedge,
        "activation": known.activation,
        "defuzzifier": known.defuzzifier,
        "formula": known.function,
    }
    return {kind: sorted(factory) for kind, factory in factories.items()}


def main() -> None:
    """Ask for the words, and ask every engine."""
    (FOLDER / "constructs.json").write_text(json.dumps(constructs(), indent=2) + "\n", "utf-8")
    warnings.simplefilter("ignore")
    values = {}
    for path in sorted(FOLDER.glob("*.fll")):
        values[path.stem] = answers(fuzzylite.FllImporter().from_file(path)).astype(np.float32)
    np.savez_compressed(FOLDER / "values.npz", **values)


if __name__ == "__main__":
    main()
