"""Compiled engines compared with FuzzyLite's own values, which tests/data/fuzzy/reference.py stored."""

from __future__ import annotations

import numpy as np
import pytest

from codra_dsl.language.fuzzy import write_fll
from tests.language.fuzzy.engines import FOLDER, NAMES, engine_of, loaded, script, stored

TOLERANCE = 1e-6


@pytest.mark.parametrize("name", NAMES)
def test_a_compiled_engine_equals_fuzzylite(name: str) -> None:
    """Compare 1,000 rows, with infinite and missing inputs, and with values that are kept from the previous row."""
    engine, module = stored(name), loaded(stored(name))
    expected = np.load(FOLDER / "values.npz")[name].astype(float)
    rows = script("samples").rows(name, [(variable.minimum, variable.maximum) for variable in engine.inputs])
    previous = (float("nan"),) * len(engine.outputs)
    for row, values in zip(rows, expected, strict=True):
        previous = module.infer(*row, previous=previous).values
        wrong = {
            output.name: (ours, theirs)
            for output, ours, theirs in zip(engine.outputs, previous, values.tolist(), strict=True)
            if not np.isclose(ours, theirs, rtol=TOLERANCE, atol=TOLERANCE, equal_nan=True)
        }

        assert wrong == {}, row


def test_the_stored_engines_are_the_output_of_the_script() -> None:
    made = {f"{make.__name__}.fll": make() for make in script("engines").ENGINES}
    written = {path.name: path.read_text("utf-8").splitlines()[1:] for path in FOLDER.glob("*.fll")}

    assert made == written


@pytest.mark.parametrize("name", NAMES)
def test_a_written_engine_is_read_back(name: str) -> None:
    engine = stored(name)
    text = write_fll(engine)

    assert engine_of(text) == engine
    assert write_fll(engine_of(text)) == text
