"""`python -m tests.campaigns.hostile [COUNT] [--kind KIND ...]`: read hostile inputs of each kind under watch.

It prints a table, keeps each input that broke a reader in the folder `--keep`, and exits with 1 if there is one.

Failures are: an exception or the exit code 70, more than 5 s of the processor or 300 MB for one input, the end of the
process, running code of an input, opening a file outside of the project, writing a file outside of the output, and
starting a process (other than git, for revisions) or opening a socket.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path

from tests.campaigns.hostile.kinds import KINDS
from tests.campaigns.hostile.running import HEADER, Campaign

_MAX_SHOWN = 20


def main() -> int:
    """Print the figures and return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.campaigns.hostile")
    parser.add_argument("count", type=int, nargs="?", default=10_000, help="the number of inputs of each kind")
    parser.add_argument("--kind", action="append", choices=list(KINDS), help="only this kind; may be repeated")
    parser.add_argument("--seed", type=int, default=2026)
    parser.add_argument("--first", type=int, default=0, help="the number of the first input")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="the number of processes")
    parser.add_argument("--keep", type=Path, default=Path("build/hostile"), help="the folder for failing inputs")
    options = parser.parse_args()
    failures = []
    with tempfile.TemporaryDirectory(prefix="hostile-") as folder:
        kinds = {name: KINDS[name] for name in options.kind or KINDS}
        campaign = Campaign(kinds, Path(folder).resolve(), options.seed, options.keep.absolute())
        numbers = range(options.first, options.first + options.count)
        print(HEADER, flush=True)
        for row in campaign.run(numbers, options.workers):
            print(row.text(), flush=True)
            failures += [f"{row.name} {outcome.number}: {outcome.failure}" for outcome in row.failures()]
    print(*failures[:_MAX_SHOWN], sep="\n")
    if failures:
        print(f"{len(failures)} failures; the inputs are in {options.keep}")
    return int(bool(failures))


if __name__ == "__main__":
    sys.exit(main())
