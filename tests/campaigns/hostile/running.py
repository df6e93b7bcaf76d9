"""Read hostile inputs in batches: each batch in a process of its own, under an audit hook and limits."""

from __future__ import annotations

import contextlib
import gc
import multiprocessing
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from random import Random

from tests.campaigns.hostile.reading import OUT, Answer, Files, Kind, captured, changed_files, write
from tests.campaigns.hostile.watch import Watch

MAX_CPU_S = 5.0
MAX_BYTES = 300e6
HANG_S = 300
"""The real time after which a process that reads one input is killed."""

ADDRESS_SPACE_BYTES = 2 << 30
BATCH = 100
WARM_UP = 5
"""The number of inputs at the start of each batch that perform lazy imports; they are not counted."""

REFUSED = Answer(is_accepted=False)
Manager = multiprocessing.get_context("fork")


@dataclass(frozen=True)
class Outcome:
    """The result of reading one input.

    Attributes:
        cpu_s: the time of the processor that reading took, with the processes that it started.
        peak_bytes: the peak memory of the process that read the input.
        failure: what went wrong; empty if the reader kept its promises.
    """

    number: int
    answer: Answer = REFUSED
    cpu_s: float = 0.0
    peak_bytes: int = 0
    failure: str = ""


@dataclass
class Row:
    """The outcomes of all inputs of one kind."""

    name: str
    outcomes: list[Outcome] = field(default_factory=list)

    def failures(self) -> list[Outcome]:
        """Return the outcomes of inputs that broke a reader, in the order of their numbers."""
        return sorted((outcome for outcome in self.outcomes if outcome.failure), key=lambda outcome: outcome.number)

    def text(self) -> str:
        """Return a line of the table."""
        accepted = sum(outcome.answer.is_accepted for outcome in self.outcomes)
        slowest = max(self.outcomes, key=lambda outcome: outcome.cpu_s, default=Outcome(0))
        largest = max(self.outcomes, key=lambda outcome: outcome.peak_bytes, default=Outcome(0))
        codes = {code for outcome in self.outcomes for code in outcome.answer.codes}
        return (
            f"{self.name:10}{len(self.outcomes):8}{accepted:10}{len(self.outcomes) - accepted:9}{len(codes):9}"
            f"{slowest.cpu_s:9.2f} (#{slowest.number:<6}){largest.peak_bytes / 1e6:8.0f} (#{largest.number:<6})"
            f"{len(self.failures()):9}"
        )


HEADER = "kind        inputs  accepted  refused  answers  slowest CPU s       peak MB           failures"


@dataclass(frozen=True)
class Campaign:
    """A run over inputs of several kinds.

    Attributes:
        kinds: the kinds by name.
        folder: where the inputs are written while they are read.
        seed: with the kind and the number, determines an input.
        keep: the folder for inputs that broke a reader; None to keep none.
    """

    kinds: Mapping[str, Kind]
    folder: Path
    seed: int
    keep: Path | None = None

    def run(self, numbers: Sequence[int], workers: int) -> Iterator[Row]:
        """Read inputs of each kind, and yield a row for each kind when it is complete."""
        for name in self.kinds:
            row = Row(name)
            for outcome in self._outcomes(name, numbers, workers):
                row.outcomes.append(outcome)
                if outcome.failure and self.keep is not None:
                    self._keep(name, outcome)
                if sys.stderr.isatty() or len(row.outcomes) % 1000 == 0:
                    end = "\r" if sys.stderr.isatty() else "\n"
                    print(f"{name}: {len(row.outcomes)} of {len(numbers)}", end=end, file=sys.stderr, flush=True)
            yield row

    def files(self, name: str, number: int) -> Files:
        """Return an input."""
        return self.kinds[name].make(Random(f"{self.seed}/{name}/{number}"))

    def _outcomes(self, name: str, numbers: Sequence[int], workers: int) -> Iterator[Outcome]:
        self.kinds[name].prepare()
        pending = deque(numbers[start : start + BATCH] for start in range(0, len(numbers), BATCH))
        running: dict[Connection, tuple[BaseProcess, deque[int]]] = {}
        while pending or running:
            while pending and len(running) < workers:
                batch = pending.popleft()
                receiver, sender = Manager.Pipe(duplex=False)
                process = Manager.Process(target=self._read_batch, args=(name, batch, sender))
                process.start()
                sender.close()
                running[receiver] = (process, deque(batch))
            for ready in wait(list(running)):
                assert isinstance(ready, Connection)
                process, unread = running[ready]
                try:
                    yield ready.recv()
                    unread.popleft()
                except EOFError:
                    process.join()
                    del running[ready]
                    if unread:  # the process was ended while it read the first of these
                        yield Outcome(unread.popleft(), failure=f"the process ended: exit code {process.exitcode}")
                        pending.append(tuple(unread))

    def _read_batch(self, name: str, numbers: Sequence[int], sender: Connection) -> None:
        gc.freeze()
        sys.dont_write_bytecode = True
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE_BYTES, ADDRESS_SPACE_BYTES))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        watch = Watch()
        sys.addaudithook(watch)
        for number in (*range(-WARM_UP, 0), *numbers):
            signal.alarm(HANG_S)
            outcome = self._read(name, number, watch)
            if number >= 0:
                sender.send(outcome)
        signal.alarm(0)

    def _read(self, name: str, number: int, watch: Watch) -> Outcome:
        kind, root = self.kinds[name], self.folder / f"{name}-{number}-{os.getpid()}"
        files = self.files(name, number)
        root.mkdir()
        write(files, root)
        tempfile.tempdir = os.environ["XDG_CACHE_HOME"] = str(root / OUT)
        os.chdir(root)
        Path("/proc/self/clear_refs").write_text("5")  # the peak memory begins anew
        watch.arm(root, root / OUT, [root / part for part in kind.changes], is_recording=number >= 0)
        start_s, answer, failure = _cpu_s(), REFUSED, ""
        try:
            with captured():
                answer = kind.read(root)
        except Exception as error:  # noqa: BLE001 - any exception is a crash
            places = [
                f"{frame.filename.rpartition('/')[2]}:{frame.lineno}"
                for frame in traceback.extract_tb(error.__traceback__)
            ]
            failure = f"{type(error).__name__}: {error!s:.900} ({' '.join(places[-4:])})"
        finally:
            watch.disarm()
        cpu_s, peak_bytes = _cpu_s() - start_s, _peak_bytes()
        problems = [failure] if failure else []
        problems += watch.take_breaches()[:3]
        problems += [f"changed {path!r:.100}" for path in changed_files(files, root, kind.changes)[:3]]
        problems += [f"{cpu_s:.1f} s of the processor"] if cpu_s > MAX_CPU_S else []
        problems += [f"{peak_bytes / 1e6:.0f} MB"] if peak_bytes > MAX_BYTES else []
        os.chdir(self.folder)
        tempfile.tempdir = None
        with contextlib.suppress(OSError):
            shutil.rmtree(root)
        return Outcome(number, answer, cpu_s, peak_bytes, "; ".join(problems))

    def _keep(self, name: str, outcome: Outcome) -> None:
        assert self.keep is not None
        folder = self.keep / f"{name}-{self.seed}-{outcome.number}"
        shutil.rmtree(folder, ignore_errors=True)
        write(self.files(name, outcome.number), folder / "input")
        (folder / "failure.txt").write_text(f"{outcome.failure}\n", encoding="utf-8", errors="backslashreplace")


def _cpu_s() -> float:
    times = os.times()
    return time.process_time() + times.children_user + times.children_system


def _peak_bytes() -> int:
    status_text = Path("/proc/self/status").read_text(encoding="utf-8")
    return int(status_text.split("VmHWM:")[1].split()[0]) * 1024
