"""FuzzyLite's side of the fuzzy rows, in the environment that has it: a turn for each line that it is sent.

It is sent the rows of context as JSON once, then `scalar N` (N rows, one call each) or `vectorised N` (N rows in one
call); it answers with the processor time in seconds per row, and first of all with the weights of the rows.
"""

from __future__ import annotations

import json
import sys
import time
import warnings
from pathlib import Path

import fuzzylite
import numpy as np

FOLDER = Path(__file__).parents[1] / "tests" / "data" / "fuzzy"


def main() -> None:
    """Answer until the input ends."""
    warnings.simplefilter("ignore")
    importer = fuzzylite.FllImporter()
    metrics, actions = (importer.from_file(FOLDER / f"store_{stage}.fll") for stage in ("metrics", "actions"))
    rows = np.array(json.loads(sys.stdin.readline()))

    def cascade(context: np.ndarray) -> np.ndarray:
        for variable, value in zip(metrics.input_variables, context.T, strict=True):
            variable.value = value
        metrics.process()
        first = [context.T[0], context.T[2], context.T[4], *(each.value for each in metrics.output_variables)]
        for variable, value in zip(actions.input_variables, first, strict=True):
            variable.value = value
        actions.process()
        return actions.output_values

    print(json.dumps([cascade(row).ravel().tolist() for row in rows]), flush=True)
    for line in sys.stdin:
        kind, count = line.split()
        chosen = rows[: int(count)]
        began_s = time.process_time()
        if kind == "scalar":
            for row in chosen:
                cascade(row)
        else:
            cascade(chosen)
        print((time.process_time() - began_s) / len(chosen), flush=True)


if __name__ == "__main__":
    main()
