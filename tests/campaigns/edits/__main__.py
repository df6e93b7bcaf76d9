"""`python -m tests.campaigns.edits [COUNT [SEED]]`: compare runs after each of COUNT random edits.

It prints the edits, and how many results of specs were used again. It exits with 1 at the first difference.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from tests.campaigns.edits.comparison import Comparison, DifferenceError
from tests.campaigns.edits.project import large_project


def main(count: int = 2000, seed: int = 1) -> int:
    """Print the figures and return the exit code."""
    with tempfile.TemporaryDirectory(prefix="edits-") as folder:
        comparison = Comparison(large_project(), Path(folder).resolve(), seed)
        for number in range(1, count + 1):
            try:
                comparison.step()
            except DifferenceError as difference:
                print(f"seed {seed}, edit {number}: {difference}")
                return 1
            if sys.stderr.isatty():
                print(f"\r{number} of {count}", end="", file=sys.stderr)
        print(f"{count} edits, seed {seed}: no difference")
        for name, edit_count in sorted(comparison.edit_counts.items()):
            print(f"{edit_count:6} {name}")
        print(f"{comparison.reused_count} of {comparison.result_count} results of specs were used again in memory")
    return 0


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
