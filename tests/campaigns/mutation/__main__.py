"""`python -m tests.campaigns.mutation`: change one expression of the product at a time, and run its tests.

The sample of a seed does not depend on unrelated changes of the repository. Results are kept in `runs/`: a run that
was interrupted goes on where it stopped, and more `--stages` continue with the changes that survived.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
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


@dataclass(frozen=True)
class Result:
    """The test that failed with a mutant; None if no test of so many stages failed."""

    name: str
    room: str
    diff: str
    failed: str | None
    stages: int


def sample(root: Path, count: int, seed: int) -> list[Mutant]:
    """Return a uniform sample of all mutants; a smaller sample with the same seed is the beginning of a larger one."""
    found = [mutant for file, room in modules(root) for mutant in _mutants_of(root, file, room)]
    found.sort(key=lambda mutant: hashlib.sha256(f"{seed} {mutant.name}".encode()).digest())
    return list(islice((mutant for mutant in found if mutant.change.is_valid), count))


def _mutants_of(root: Path, file: str, room: str) -> Iterator[Mutant]:
    occurrences = Counter[str]()
    for change in changes((root / file).read_bytes()):
        occurrences[str(change)] += 1
        yield Mutant(f"{file}: {change} #{occurrences[str(change)]}", file, room, change)


def report(results: Sequence[Result]) -> str:
    """Return the changes that survived, and a table of the rooms."""
    rows = [f"{result.diff}\n" for result in results if result.failed is None]
    rows.append("| room | killed | of | |\n| --- | --- | --- | --- |")
    for room in (*dict.fromkeys(ROOM_BY_PATH.values()), "together"):
        of_room = [result for result in results if room in {result.room, "together"}]
        killed_count = sum(result.failed is not None for result in of_room)
        rows.append(f"| {room} | {killed_count} | {len(of_room)} | {killed_count / max(1, len(of_room)):.0%} |")
    return "\n".join(rows)


def run(mutants: Sequence[Mutant], known: dict[str, Result], stages: int, workers: int) -> Iterator[Result]:
    """Yield the results of mutants that are not known well enough, in the order of the mutants."""
    imports = imports_by_test(ROOT)
    free = SimpleQueue[Copies]()

    def judge(mutant: Mutant) -> Result:
        done_stages = known[mutant.name].stages if mutant.name in known else 0
        tests = list(tests_of(mutant.file, imports))[done_stages:stages]
        used = free.get()
        try:
            failed = used.failure(mutant.file, mutant.change.result, tests)
        finally:
            free.put(used)
        return Result(mutant.name, mutant.room, mutant.change.diff(mutant.file), failed, stages)

    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(workers) as executor:
        for pair in copies(ROOT, Path(folder), workers):
            free.put(pair)
        yield from executor.map(judge, mutants)


def main(arguments: Sequence[str]) -> None:
    """Print the results while they are found, then the survivors and the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.campaigns.mutation", description=__doc__)
    parser.add_argument("--count", type=int, default=400, help="how many mutants are judged")
    parser.add_argument("--seed", type=int, default=1, help="which mutants are judged")
    parser.add_argument("--stages", type=int, default=5, help="how many stages of tests are run, the nearest first")
    parser.add_argument("--workers", type=int, default=1, help="how many mutants are judged at a time")
    options = parser.parse_args(arguments)
    file = ROOT / "runs" / f"mutation-{options.seed}.jsonl"
    file.parent.mkdir(exist_ok=True)
    file.touch()
    known = {result.name: result for result in (Result(**json.loads(line)) for line in file.open(encoding="utf-8"))}
    mutants = sample(ROOT, options.count, options.seed)
    is_known = {name for name, result in known.items() if result.failed or result.stages >= options.stages}
    remaining = [mutant for mutant in mutants if mutant.name not in is_known]
    start_s = time.monotonic()
    for number, result in enumerate(run(remaining, known, options.stages, options.workers) if remaining else (), 1):
        known[result.name] = result
        with file.open("a", encoding="utf-8") as output:
            output.write(f"{json.dumps(asdict(result))}\n")
        elapsed = f"{number}/{len(remaining)} {time.monotonic() - start_s:.0f} s"
        print(f"[{elapsed}] {result.name}: {result.failed or 'SURVIVED'}", flush=True)
    print(report([known[mutant.name] for mutant in mutants if mutant.name in known]))


if __name__ == "__main__":
    main(sys.argv[1:])
