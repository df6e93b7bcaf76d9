"""Journals whose writing is interrupted: by signals, by exceptions of handlers, and by other programs."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from codra_dsl.runtime import Journal
from codra_dsl.runtime.journal import Event, Kind
from codra_dsl.runtime.journal import journal as journal_module
from codra_dsl.runtime.journal.reader import JournalError, JournalReader
from codra_dsl.runtime.journal.run_header import RunHeader
from tests.runtime.journal.journals import messages, read, run_door

ROOT = Path(__file__).parents[3]
JOURNAL_FOLDER = str(Path(journal_module.__file__).parent)
LARGE_BYTES = 20_000


@pytest.fixture(scope="module")
def header(tmp_path_factory: pytest.TempPathFactory) -> RunHeader:
    path = tmp_path_factory.mktemp("header") / "run.mcap"
    run_door(path, loops=1)
    return read(path)[0]


class HandlerError(TimeoutError):
    """Raised by a signal handler; it is an `OSError`, like an error of the file."""


def numbered(number: int) -> Event:
    """Return an event; some events are so large that a chunk holds only three of them, or not even one."""
    size = 70_000 if number % 9 == 8 else LARGE_BYTES if number % 3 else 10
    return Event(float(number), Kind.VARIABLE, ("near", "open")[number % 2], "unknown", {"detail": f"{number}" * size})


def numbers_in(path: Path) -> list[int]:
    with JournalReader(path) as reader:
        numbers = [int(event.instant_s) for event in reader.events()]
    assert (reader.damage.is_torn, reader.damage.unreadable_parts, reader.damage.lost_message_count) == (False, [], 0)
    assert len(messages(path)) == len(numbers) + 1
    return numbers


@contextmanager
def interrupted_at(instruction: int, interrupt: Callable[[], None]) -> Iterator[list[int]]:
    """Call a function at one instruction of the journal's code; yield a list with the number of instructions so far.

    Python runs signal handlers after calls only, so it never does so between the end of a `with` block and the release
    of its lock. Therefore instructions of `_accept`, which holds the lock, are not interrupted directly.
    """
    count = [0]

    def trace(frame: FrameType, event: str, _: Any) -> Any:
        if not frame.f_code.co_filename.startswith(JOURNAL_FOLDER) or frame.f_code.co_name == "_accept":
            return None if event == "call" and frame.f_code.co_name != "_accept" else trace
        frame.f_trace_opcodes = True
        if event == "opcode":
            count[0] += 1
            if count[0] == instruction:
                interrupt()
        return trace

    outer_trace = sys.gettrace()
    sys.settrace(trace)
    try:
        yield count
    finally:
        sys.settrace(outer_trace)


def begun(path: Path, header: RunHeader) -> Journal:
    journal = Journal(path)
    journal.begin(lambda: header)
    return journal


def instructions_of(path: Path, header: RunHeader) -> range:
    """Return twenty of the instructions that the journal executes for some events and its end."""
    journal = begun(path, header)
    with interrupted_at(0, lambda: None) as count:
        write_numbers(journal)
    return range(1, count[0], count[0] // 20)


def write_numbers(journal: Journal) -> list[int]:
    """Write events and end the journal, in spite of exceptions; return the numbers of the acknowledged events."""
    acknowledged = []
    for number in range(12):
        with suppress(KeyboardInterrupt, HandlerError):
            journal.add(numbered(number))
            acknowledged.append(number)
    for _ in range(2):
        with suppress(KeyboardInterrupt, HandlerError):
            journal.end()
    return acknowledged


@pytest.mark.parametrize("error", [KeyboardInterrupt, HandlerError])
def test_an_exception_at_any_instruction_propagates_and_loses_no_acknowledged_event(
    tmp_path: Path, header: RunHeader, error: type[BaseException]
) -> None:
    instructions, path = instructions_of(tmp_path / "whole.mcap", header), tmp_path / "run.mcap"
    raised_count = 0

    def raise_error() -> None:
        nonlocal raised_count
        raised_count += 1
        raise error

    for instruction in instructions:
        journal = begun(path, header)
        with interrupted_at(instruction, raise_error):
            acknowledged = write_numbers(journal)
        assert journal.failure is None
        assert set(acknowledged) <= set(numbers_in(path))
    assert raised_count >= 20


def test_a_handler_at_any_instruction_may_write_and_end_the_journal(tmp_path: Path, header: RunHeader) -> None:
    instructions, path = instructions_of(tmp_path / "whole.mcap", header), tmp_path / "run.mcap"
    for instruction in instructions[::2]:
        journal = begun(path, header)
        with interrupted_at(instruction, lambda journal=journal: journal.add(numbered(100))):  # type: ignore[misc]
            acknowledged = write_numbers(journal)
        numbers = numbers_in(path)
        assert [number for number in numbers if number != 100] == acknowledged
        assert journal.failure is None

        journal = begun(path, header)
        with interrupted_at(instruction, journal.end):
            acknowledged = write_numbers(journal)
        numbers = numbers_in(path)
        assert numbers == acknowledged[: len(numbers)]


def test_signals_at_random_instants_lose_no_acknowledged_event() -> None:
    """`make signals` runs five hundred programs; these runs are a sample under each kind of signal."""
    command = [sys.executable, "-m", "tests.campaigns.signals", "4", "7"]
    done = subprocess.run(command, cwd=ROOT, check=False, text=True, capture_output=True)

    assert done.returncode == 0, done.stdout + done.stderr
    assert "4 runs" in done.stdout
    assert " 0 signals" not in done.stdout
    assert "mistakes: 0\n" in done.stdout


# Other programs


def truncate(path: Path) -> None:
    os.truncate(path, 0)


def cut(path: Path) -> None:
    os.truncate(path, path.stat().st_size - 1)


def overwrite(path: Path) -> None:
    path.write_bytes(b"overwritten" * 50_000)


def remove(path: Path) -> None:
    path.unlink()


@pytest.mark.parametrize(
    ("change", "failure"),
    [
        (truncate, "OSError: [Errno 5] the file was truncated while it was being written"),
        (cut, "OSError: [Errno 5] the file was truncated while it was being written"),
        (overwrite, "OSError: [Errno 5] the file was overwritten while it was being written"),
        (remove, "FileNotFoundError: [Errno 2] the file was removed while it was being written"),
    ],
)
def test_a_file_that_another_program_changes_is_noticed(
    tmp_path: Path, header: RunHeader, change: Callable[[Path], None], failure: str
) -> None:
    journal = begun(tmp_path / "run.mcap", header)
    for number in range(6):
        journal.add(numbered(number))
    change(journal.path)
    journal.add(numbered(6))
    assert (journal.failure is None) == (change in (overwrite, remove))
    journal.end()

    assert journal.failure == failure


@pytest.mark.parametrize("content_bytes", [0, 5_000])
def test_readers_report_a_truncated_file(tmp_path: Path, content_bytes: int) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(bytes(content_bytes))

    with pytest.raises(JournalError, match="truncated"):
        JournalReader(path)


def test_an_event_that_cannot_be_encoded_ends_the_journal_and_keeps_the_events_before(
    tmp_path: Path, header: RunHeader, caplog: pytest.LogCaptureFixture
) -> None:
    journal = begun(tmp_path / "run.mcap", header)
    journal.add(numbered(0))
    journal.add(Event(1.0, Kind.VARIABLE, "near", "unknown", {"detail": object()}))
    journal.add(numbered(3))

    assert journal.failure == "TypeError: Object of type object is not JSON serializable"
    assert len(caplog.records) == 1
    with JournalReader(journal.path) as reader:
        assert [event.instant_s for event in reader.events()] == [0.0]


FORKS_BESIDE_THREADS = """
import os, sys, threading
from codra_dsl.runtime import ContextManager, Journal, WallClock
from tests.campaigns.signals.writer import model
from tests.runtime.forests import World
journal, clock = Journal(sys.argv[1]), WallClock()
manager = ContextManager(model(), clock=clock, resources={"world": World()}, record=journal)
manager.subscribe("count", lambda reading: None)
is_over = False
def write():
    while not is_over:
        manager.set("count", 1)
threads = [threading.Thread(target=write) for _ in range(3)]
for thread in threads:
    thread.start()
for number in range(30):
    if not (child := os.fork()):
        manager.set("count", -1)
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0
is_over = True
for thread in threads:
    thread.join()
manager.close()
print(journal.failure)
"""


def test_a_child_that_is_forked_beside_writing_threads_can_set_and_writes_nothing(tmp_path: Path) -> None:
    command = [sys.executable, "-c", FORKS_BESIDE_THREADS, str(tmp_path / "run.mcap")]
    done = subprocess.run(command, cwd=ROOT, check=True, text=True, capture_output=True, timeout=60)

    assert done.stdout == "None\n"
    with JournalReader(tmp_path / "run.mcap") as reader:
        values = [event.details["value"] for event in reader.events() if event.kind is Kind.VARIABLE]
    assert set(values) == {1}
    assert (reader.damage.is_torn, reader.damage.lost_message_count) == (False, 0)
