"""Write the outputs of FuzzyLite for each engine and row of `samples`, and its keywords.

The outputs go to values.npz, the keywords to constructs.json. The script runs in a separate environment, because
pyfuzzylite is GPL and needs an old numpy; only its results are kept:

    make .venv-fuzzylite/.ready
    .venv-fuzzylite/bin/python tests/data/fuzzy/reference.py

Values are stored in single precision, with a relative error of at most 6e-8; infinities and NaN are kept.
"""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import fuzzylite
import numpy as np
import samples

FOLDER = Path(__file__).parent


def compute_outputs(engine: fuzzylite.Engine) -> np.ndarray:
    """Return the outputs of an engine for all rows, one at a time; the state that it keeps from earlier rows counts."""
    ranges = [(float(variable.minimum), float(variable.maximum)) for variable in engine.input_variables]
    values = []
    for row in samples.rows(engine.name, ranges):
        for variable, value in zip(engine.input_variables, row, strict=True):
            variable.value = value
        engine.process()
        values.append(
            [float(np.asarray(output_variable.value).ravel()[0]) for output_variable in engine.output_variables]
        )
    return np.array(values)


def constructs() -> dict[str, list[str]]:
    """Return the keywords of FuzzyLite in FLL, by kind."""
    factory_manager = fuzzylite.settings.factory_manager
    factories = {
        "term": factory_manager.term,
        "T-norm": factory_manager.tnorm,
        "S-norm": factory_manager.snorm,
        "hedge": factory_manager.hedge,
        "activation": factory_manager.activation,
        "defuzzifier": factory_manager.defuzzifier,
        "formula": factory_manager.function,
    }
    return {kind: sorted(factory) for kind, factory in factories.items()}


def main() -> None:
    """Write the keywords, and the outputs of every engine."""
    (FOLDER / "constructs.json").write_text(json.dumps(constructs(), indent=2) + "\n", "utf-8")
    warnings.simplefilter("ignore")
    values = {}
    for path in sorted(FOLDER.glob("*.fll")):
        values[path.stem] = compute_outputs(fuzzylite.FllImporter().from_file(path)).astype(np.float32)
    np.savez_compressed(FOLDER / "values.npz", **values)


if __name__ == "__main__":
    main()
