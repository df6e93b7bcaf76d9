"""`python -m tests.campaigns.keystrokes [COUNT [SEED]]`: compare an editor with `codra lint` after COUNT random edits.

Nine of ten edits are made in a small project. It prints the kinds of edits and requests, and exits with 1 at the first
difference, or if a request fails.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from pygls.exceptions import JsonRpcException

from tests.campaigns.edits.project import large_project, small_project
from tests.campaigns.keystrokes.comparison import Comparison, DifferenceError
from tests.tooling.language_server.editor import SERVER_WITHOUT_PAUSE, Editor

LARGE_SHARE = 0.1
"""The share of the edits that are made in the large project, which takes five times as long to lint."""


def main(count: int = 2000, seed: int = 1) -> int:
    """Print the figures and return the exit code."""
    large_count = round(count * LARGE_SHARE)
    for files, edit_count in ((small_project(), count - large_count), (large_project(), large_count)):
        editor = Editor(SERVER_WITHOUT_PAUSE)
        editor.start()
        with tempfile.TemporaryDirectory(prefix="keystrokes-") as folder:
            comparison = Comparison(editor, files, Path(folder).resolve(), seed)
            try:
                _edit(comparison, edit_count)
            except (DifferenceError, JsonRpcException) as error:
                print(f"seed {seed}: {error}")
                return 1
        print(f"{edit_count} edits, seed {seed}: no difference; the server ended with {editor.stop()}\n")
    return 0


def _edit(comparison: Comparison, count: int) -> None:
    """Make edits, and print how many there were of each kind."""
    for number in range(1, count + 1):
        comparison.step()
        if sys.stderr.isatty():
            print(f"\r{number} of {count}", end="", file=sys.stderr)
    for name, step_count in sorted(comparison.counts.items()):
        print(f"{step_count:6} {name}")


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
