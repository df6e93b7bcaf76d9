"""`python -m tests.campaigns.hostile [COUNT [SEED [FIRST]]]`: compile hostile inputs under watch.

It exits with 1 if there is a failure.

Failures are: an exception, an input that takes more than 2 s of CPU time, more than 500 MB in total, execution of code
from a spec, opening or writing a file outside of the project, and starting a process or opening a socket.
"""

from __future__ import annotations

import sys

from tests.campaigns.hostile.watch import run

MOST_SECONDS = 2.0
MOST_BYTES = 500e6


def main(count: int = 10_000, seed: int = 2026, first: int = 0) -> int:
    """Print the figures and return the exit code."""
    session = run(seed, first, count)
    print(session.report())
    has_breach = session.breaches or any(
        outcome.crash or outcome.seconds > MOST_SECONDS for outcome in session.outcomes
    )
    return int(bool(has_breach) or session.peak_bytes > MOST_BYTES)


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
