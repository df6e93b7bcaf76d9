"""`python -m tests.campaigns.mutation [COUNT [SEED [WORKERS]]]`: change one expression at a time, and run its tests.

Results are kept in `runs/`: a run that was interrupted goes on, and a later run judges only the survivors again.
"""

from __future__ import annotations

import hashlib
import json
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from queue import SimpleQueue

from tests.campaigns.mutation.belonging import ROOM_BY_PATH, imports_by_test, modules, tests_of
from tests.campaigns.mutation.changes import Change, changes
from tests.campaigns.mutation.trial import Copies, copies

ROOT = Path(__file__).parents[3]


@dataclass(frozen=True)
class Mutant:
    """One change of one module; its name stays when other lines change."""

    name: str
    file: str
    room: str
    change: Change


def sample(count: int, seed: int) -> list[Mutant]:
    """Return a uniform sample of all mutants; a smaller sample with the same seed is the beginning of a larger one."""
    found = [mutant for file, room in modules(ROOT) for mutant in _mutants_of(file, room)]
    found.sort(key=lambda mutant: hashlib.sha256(f"{seed} {mutant.name}".encode()).digest())
    return list(islice((mutant for mutant in found if mutant.change.is_valid), count))


def _mutants_of(file: str, room: str) -> Iterator[Mutant]:
    occurrences = Counter[str]()
    for change in changes((ROOT / file).read_bytes()):
        occurrences[str(change)] += 1
        yield Mutant(f"{file}: {change} #{occurrences[str(change)]}", file, room, change)


def judged(mutants: Sequence[Mutant], workers: int) -> Iterator[tuple[Mutant, str | None]]:
    """Yield each mutant with the test that fails, or None if all tests pass."""
    imports, free = imports_by_test(ROOT), SimpleQueue[Copies]()

    def failure(mutant: Mutant) -> str | None:
        used = free.get()
        try:
            return used.failure(mutant.file, mutant.change.result, tests_of(mutant.file, imports))
        finally:
            free.put(used)

    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(workers) as executor:
        for pair in copies(ROOT, Path(folder), workers):
            free.put(pair)
        yield from zip(mutants, executor.map(failure, mutants), strict=True)


def report(mutants: Sequence[Mutant], failures: Mapping[str, str | None]) -> str:
    """Return the changes that survived, and a table of the rooms."""
    rows = [f"{mutant.change.diff(mutant.file)}\n" for mutant in mutants if failures[mutant.name] is None]
    rows.append("| room | killed | of | |\n| --- | --- | --- | --- |")
    for room in (*dict.fromkeys(ROOM_BY_PATH.values()), "together"):
        killed = [failures[mutant.name] is not None for mutant in mutants if room in {mutant.room, "together"}]
        rows.append(f"| {room} | {sum(killed)} | {len(killed)} | {sum(killed) / max(1, len(killed)):.0%} |")
    return "\n".join(rows)


def main(count: int = 400, seed: int = 1, workers: int = 1) -> None:
    """Print the results while they are found, then the survivors and the table."""
    file = ROOT / "runs" / f"mutation-{seed}.jsonl"
    file.parent.mkdir(exist_ok=True)
    file.touch()
    failures: dict[str, str | None] = dict(map(json.loads, file.read_text("utf-8").splitlines()))
    mutants = sample(count, seed)
    remaining = [mutant for mutant in mutants if failures.get(mutant.name) is None]
    remaining.sort(key=lambda mutant: mutant.name in failures)  # what survived before is judged last
    for number, (mutant, failure) in enumerate(judged(remaining, workers), start=1):
        failures[mutant.name] = failure
        with file.open("a", encoding="utf-8") as output:
            output.write(f"{json.dumps((mutant.name, failure))}\n")
        print(f"[{number}/{len(remaining)}] {mutant.name}: {failure or 'SURVIVED'}", flush=True)
    print(report(mutants, failures))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
