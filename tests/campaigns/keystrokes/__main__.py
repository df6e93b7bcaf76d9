"""`python -m tests.campaigns.keystrokes [COUNT [SEED]]`: compare an editor with `codra lint` after COUNT random edits.

It prints the kinds of edits and requests, and the memory of the server. It exits with 1 at the first difference.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from tests.campaigns.edits.project import large_project
from tests.campaigns.keystrokes.comparison import Comparison, DifferenceError
from tests.tooling.language_server.editor import SERVER_WITHOUT_PAUSE, Editor


def main(count: int = 2000, seed: int = 1) -> int:
    """Print the figures and return the exit code."""
    editor = Editor(SERVER_WITHOUT_PAUSE)
    editor.start()
    with tempfile.TemporaryDirectory(prefix="keystrokes-") as folder:
        comparison = Comparison(editor, large_project(), Path(folder).resolve(), seed)
        for number in range(1, count + 1):
            try:
                comparison.step()
            except DifferenceError as difference:
                print(f"seed {seed}, edit {number}: {difference}")
                return 1
            if sys.stderr.isatty():
                print(f"\r{number} of {count}", end="", file=sys.stderr)
        for name, step_count in sorted(comparison.counts.items()):
            print(f"{step_count:6} {name}")
    exit_code = editor.stop()
    print(f"{count} edits, seed {seed}: no difference; the server ended with {exit_code}")
    return exit_code


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
