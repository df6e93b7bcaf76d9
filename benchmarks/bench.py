"""`make bench`: measure every row and its peer, and write `results.json`.

`python benchmarks/bench.py GROUP...` measures some groups, such as `compiling`. Each row about a running forest is a
group of its own, with the name of the row.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import adapting
import compiling
import editing
import fuzzy
import isolation
import journals
import knowledge
import networking
import running
from rows import PeerMissingError, Row

GROUPS: Mapping[str, Callable[[Path], Iterator[Row]]] = {
    "adapting": adapting.rows,
    "compiling": compiling.rows,
    "editing": editing.rows,
    "fuzzy": fuzzy.rows,
    "isolation": isolation.rows,
    "journals": journals.rows,
    "knowledge": knowledge.rows,
    "networking": networking.rows,
    **running.GROUPS,
}
"""The function that measures each group of rows, given a scratch folder."""

RESULTS = Path(__file__).with_name("results.json")

EXIT_UNAVAILABLE = 2
"""The exit code if a requested group does not exist, or its peer is not installed."""


def main() -> int:
    """Measure the requested groups (by default all), keep the rows of the other groups, and return the exit code."""
    requested_groups = sys.argv[1:] or list(GROUPS)
    unknown_groups = [group for group in requested_groups if group not in GROUPS]
    if unknown_groups:
        print(f"unknown group {unknown_groups[0]!r}: there are {', '.join(GROUPS)}", file=sys.stderr)
        return EXIT_UNAVAILABLE
    print(f"{'row':24} {'ours':>10} {'peer':>10} {'ratio':>8} {'target':>8}")
    return max([_measure(group) for group in requested_groups])


def _measure(group: str) -> int:
    """Measure a group and store its rows; print one line if its peer is not installed."""
    records_by_name = {row["name"]: row for row in json.loads(RESULTS.read_text("utf-8"))} if RESULTS.exists() else {}
    try:
        with tempfile.TemporaryDirectory(prefix="codra-bench-") as scratch:
            for row in GROUPS[group](Path(scratch)):
                records_by_name[row.name] = row.record()
                verdict = "met" if row.ratio <= row.target else "missed"
                line = f"{row.name:24} {row.ours:10.4g} {row.peer:10.4g} {row.ratio:8.3g} {row.target:8} {verdict}"
                print(line, flush=True)
                lines = ",\n".join(map(json.dumps, records_by_name.values()))
                RESULTS.write_text(f"[\n{lines}\n]\n", "utf-8")
    except PeerMissingError as error:
        print(f"{group}: {error}", file=sys.stderr, flush=True)
        return EXIT_UNAVAILABLE
    return 0


if __name__ == "__main__":
    sys.exit(main())
