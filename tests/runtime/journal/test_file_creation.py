"""The file of a journal while it is created and written: other files, other programs, and a program that ends."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from codra_dsl.runtime import ContextManager, Journal, SimClock
from codra_dsl.runtime.journal.reader import JournalReader
from tests.command_server import as_text, run_python
from tests.runtime.door import MODEL, Door
from tests.runtime.journal.journals import messages, read, run_door

ROOT = Path(__file__).parents[3]
PATIENCE_S = 60.0


def run(program: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return as_text(run_python(("-W", "error", "-c", program, *map(str, arguments)), ROOT, environment))


def values(path: Path) -> list[object]:
    return [content["value"] for topic, content, *_ in messages(path) if topic == "/codra/context/localized"]


# Existing files


def test_a_file_that_is_not_a_journal_is_never_replaced(tmp_path: Path) -> None:
    foreign = b"\x89MCAP0\r\n" + bytes(5000) + b"\x89MCAP0\r\n"
    for content in (b"codra: 1\n", b"\x89PNG", foreign):
        (tmp_path / "there").write_bytes(content)
        with pytest.raises(FileExistsError, match="the file exists and is not a journal"):
            Journal(tmp_path / "there")
        assert (tmp_path / "there").read_bytes() == content


def test_a_path_that_is_not_a_regular_file_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path, tmp_path / "pipe", Path("/dev/null")):
        with pytest.raises(OSError, match="not a regular file"):
            Journal(path)


def test_a_link_leads_to_the_file_and_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "link.mcap").symlink_to(tmp_path / "target.mcap")
    for _ in range(2):
        run_door(tmp_path / "link.mcap", loops=1)

    assert (tmp_path / "link.mcap").is_symlink()
    assert read(tmp_path / "target.mcap") == read(tmp_path / "link.mcap")
    assert len(list(tmp_path.iterdir())) == 2


def test_an_empty_file_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "run.mcap").touch()
    run_door(tmp_path / "run.mcap", loops=1)

    assert [path.name for path in tmp_path.iterdir()] == ["run.mcap"]


READ_ONLY = """
import os, sys
from codra_dsl.runtime import Journal
if os.getuid() == 0:
    os.setuid(65534)  # root may write everywhere
try:
    Journal(sys.argv[1])
except PermissionError as error:
    print(error.strerror)
"""


def test_a_folder_that_cannot_be_written_raises(tmp_path: Path) -> None:
    tmp_path.chmod(0o555)

    assert run(READ_ONLY, tmp_path / "run.mcap").stdout == "Permission denied\n"


# Two programs

TWO = """
import sys
from codra_dsl.runtime import ContextManager, Journal, SimClock
from tests.runtime.door import MODEL, Door
journal = Journal(sys.argv[1])
with ContextManager(MODEL, clock=SimClock(), resources={"door": Door()}, record=journal) as manager:
    print("begun", flush=True)
    sys.stdin.readline()
    for _ in range(2000):
        manager.set("localized", sys.argv[2] == "first")
"""


def test_a_second_program_with_the_same_path_leaves_the_first_its_file(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    writers = []
    for name in ("first", "second"):
        command = [sys.executable, "-c", TWO, str(path), name]
        writer = subprocess.Popen(
            command, env={"PYTHONPATH": str(ROOT)}, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        assert writer.stdout is not None
        assert writer.stdout.readline() == "begun\n"
        writers.append(writer)
    for writer in writers:
        writer.communicate("go on\n", timeout=PATIENCE_S)

    assert values(tmp_path / "run.unfinished-1.mcap") == [True] * 2000
    assert values(path) == [False] * 2000


def test_programs_that_begin_at_the_same_time_get_separate_files(tmp_path: Path) -> None:
    program = TWO.replace('print("begun", flush=True)\n    sys.stdin.readline()', "pass").replace("2000", "20")
    command = [sys.executable, "-c", program, str(tmp_path / "run.mcap"), "first"]
    writers = [subprocess.Popen(command, env={"PYTHONPATH": str(ROOT)}, stderr=subprocess.DEVNULL) for _ in range(6)]
    assert [writer.wait(PATIENCE_S) for writer in writers] == [0] * 6

    for path in tmp_path.iterdir():
        assert values(path) == [True] * 20


def test_two_journals_of_one_program_at_one_path_use_separate_files(tmp_path: Path) -> None:
    first, second = Journal(tmp_path / "run.mcap"), Journal(tmp_path / "run.mcap")
    for journal, value in ((first, True), (second, False)):
        with ContextManager[str, str](MODEL, clock=SimClock(), resources={"door": Door()}, record=journal) as manager:
            manager.set("localized", value)

    assert sorted(values(path)[0] for path in tmp_path.iterdir()) == [False, True]


# While it is written


def test_a_removed_file_is_reported_and_the_run_continues(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    journal, clock = Journal(tmp_path / "run.mcap"), SimClock()
    resources = {"door": Door(angle_rad=1.0)}
    with ContextManager[str, str](MODEL, clock=clock, resources=resources, record=journal) as manager:
        manager.set("localized", True)
        manager.declare("open")
        clock.sleep(1.0)
        journal.path.unlink()
        clock.sleep(1000.0)
        assert manager.get("open").value is True

    assert journal.failure == "FileNotFoundError: [Errno 2] the file was removed while it was being written"
    assert [record.levelname for record in caplog.records] == ["ERROR"]
    assert len(journal) > 1000


ENDS_IN_THE_MIDST = """
import sys, threading
from codra_dsl.runtime import ContextManager, Journal, WallClock
from tests.runtime.door import MODEL, Door
manager = ContextManager(MODEL, clock=WallClock(), resources={"door": Door()}, record=Journal(sys.argv[1]))
enough = threading.Event()
def write():
    number = 0
    while True:
        number += 1
        manager.set("localized", number % 2 == 0)
        if number == 300:
            enough.set()
threading.Thread(target=write, daemon=True).start()
assert enough.wait(60)
"""


def test_a_program_that_ends_while_its_threads_write_leaves_a_complete_file(tmp_path: Path) -> None:
    for number in range(3):
        path = tmp_path / f"{number}.mcap"
        done = run(ENDS_IN_THE_MIDST, path)
        assert (done.returncode, done.stderr) == (0, "")

        with JournalReader(path) as reader:
            numbers = [raw_message.message.sequence for raw_message in reader.raw_messages()]
        assert not reader.damage.is_torn
        assert numbers == list(range(1, len(numbers) + 1))
        assert len(messages(path)) == len(numbers) > 300


CHILD_WRITES = """
import os, sys
from codra_dsl.runtime import ContextManager, Journal, SimClock
from tests.runtime.door import MODEL, Door
manager = ContextManager(MODEL, clock=SimClock(), resources={"door": Door()}, record=Journal(sys.argv[1]))
manager.set("localized", True)
if child := os.fork():
    assert os.waitpid(child, 0)[1] == 0
    manager.set("localized", False)
    manager.close()
else:
    for _ in range(3000):
        manager.set("localized", True)
    manager.close()
"""


def test_events_of_a_child_process_are_not_in_the_journal(tmp_path: Path) -> None:
    done = run(CHILD_WRITES, tmp_path / "run.mcap")

    assert (done.returncode, done.stderr) == (0, "")
    assert values(tmp_path / "run.mcap") == [True, False]


def test_a_journal_that_is_read_while_it_is_written_has_no_gap(tmp_path: Path) -> None:
    path, stop_event = tmp_path / "run.mcap", threading.Event()
    journal = Journal(path)
    read_count, written_message_count = 0, 0
    with ContextManager[str, str](MODEL, clock=SimClock(), resources={"door": Door()}, record=journal) as manager:

        def read_repeatedly() -> None:
            nonlocal read_count
            while not stop_event.is_set():
                min_message_count = written_message_count
                with JournalReader(path) as reader:
                    reader.header()
                    sequence_numbers = [raw_message.message.sequence for raw_message in reader.raw_messages()]
                assert reader.is_live
                assert reader.damage.unreadable_parts == []
                assert sequence_numbers == list(range(1, len(sequence_numbers) + 1))
                assert len(sequence_numbers) >= min_message_count
                read_count += 1

        failures: list[BaseException] = []

        def read_and_keep_failures() -> None:
            try:
                read_repeatedly()
            except BaseException as error:  # noqa: BLE001 - reported below
                failures.append(error)

        reader_thread = threading.Thread(target=read_and_keep_failures)
        reader_thread.start()
        for number in range(6000):
            manager.set("localized", True)
            written_message_count = 2 * number
        stop_event.set()
        reader_thread.join(PATIENCE_S)
    assert failures == []
    assert read_count > 3
