"""FuzzyLite's side of the rows whose peer is FuzzyLite, run in the environment of FuzzyLite.

The first line of the input is a task as JSON: the files of both engines, the names of the inputs, and rows of input
values. The answer contains the weights of each row. Each following line is `scalar N` (N rows, one call each) or
`vectorised N` (N rows in one call); the answer is the processor time in seconds per row.
"""

from __future__ import annotations

import json
import sys
import time
import warnings
from collections.abc import Mapping

import fuzzylite
import numpy as np


def main() -> None:
    """Answer until the input ends."""
    warnings.simplefilter("ignore")
    importer, task = fuzzylite.FllImporter(), json.loads(sys.stdin.readline())
    metrics, actions = (importer.from_file(file) for file in task["engines"])
    names, rows = task["names"], np.array(task["rows"])

    def process(engine: fuzzylite.Engine, values: Mapping[str, np.ndarray]) -> None:
        for variable in engine.input_variables:
            variable.value = values[variable.name]
        engine.process()

    def cascade(context: np.ndarray) -> np.ndarray:
        values = dict(zip(names, context.T, strict=True))
        process(metrics, values)
        process(actions, values | {output.name: output.value for output in metrics.output_variables})
        return actions.output_values

    print(json.dumps([cascade(row).ravel().tolist() for row in rows]), flush=True)
    for line in sys.stdin:
        kind, count_text = line.split()
        selected_rows = rows[: int(count_text)]
        start_s = time.process_time()
        if kind == "scalar":
            for row in selected_rows:
                cascade(row)
        else:
            cascade(selected_rows)
        print((time.process_time() - start_s) / len(selected_rows), flush=True)


if __name__ == "__main__":
    main()
