"""The journal as a file: its content in independent readers, and the rest of it after a process was killed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import Counter
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from hypothesis import given as drawn
from hypothesis import settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.records import Chunk

from codra_dsl.runtime import ContextManager, EventLog, Journal, SimClock
from codra_dsl.runtime.journal import Event, Kind
from codra_dsl.runtime.journal.mcap_file import CHUNK_BYTES, OPEN_CHUNK_OPCODE
from codra_dsl.runtime.journal.reader import JournalError, JournalReader
from codra_dsl.runtime.journal.recovery import recover
from codra_dsl.runtime.values.model import integer, member, real, text
from tests.command_server import as_text, run_python
from tests.runtime.door import MODEL, Door
from tests.runtime.forests import World, forest, given
from tests.runtime.journal.journals import messages, read, records, run_door

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def long_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A journal of several chunks."""
    path = tmp_path_factory.mktemp("journal") / "run.mcap"
    run_door(path, loops=40)
    return path


@dataclass(frozen=True)
class CompleteJournal:
    """A journal with its events, which are too many for the `repr` of this class."""

    path: Path
    events: list[Event] = field(repr=False)

    @cached_property
    def event_texts(self) -> set[str]:
        return set(map(Event.as_json, self.events))


@pytest.fixture(scope="module")
def complete_journal(long_run: Path) -> CompleteJournal:
    return CompleteJournal(long_run, read(long_run)[1])


# Independent readers


def test_an_independent_reader_finds_every_event_in_order(tmp_path: Path) -> None:
    journal = run_door(tmp_path / "run.mcap")

    written_events = [
        (topic.split("/")[2], event["name"], event["what"]) for topic, event, *_ in messages(journal.path)[1:]
    ]
    events = [(kind, name, what) for kind, name, what in written_events if kind != "input"]
    folders = {"variable": "context", "job": "perception"}
    assert events == [(folders.get(event.kind, event.kind), event.name, event.what) for event in journal]


def test_every_variable_observer_and_algorithm_has_its_topic(long_run: Path) -> None:
    topics = Counter(topic for topic, *_ in messages(long_run))

    assert set(topics) == {
        "/codra/run",
        "/codra/input",
        *(f"/codra/context/{name}" for name in ("localized", "near", "open")),
        *(f"/codra/declaration/{name}" for name in ("localized", "near", "open")),
        *(f"/codra/observer/{name}" for name in ("door_distance", "door_lid")),
        *(f"/codra/perception/{name}" for name in ("measure_distance", "look")),
        "/codra/decision/open",
        *(f"/codra/expectation/{name}" for name in ("near", "open")),
    }
    assert topics["/codra/run"] == 1


def find_undescribed_fields(schema: dict[str, Any], path: str) -> list[str]:
    own_paths = [] if schema.get("description") else [path]
    path_lists = (
        find_undescribed_fields(field_schema, f"{path}.{name}")
        for name, field_schema in schema.get("properties", {}).items()
    )
    return [*own_paths, *(name for inner_paths in path_lists for name in inner_paths)]


def find_unsupported_fields(schema: dict[str, Any], path: str) -> list[str]:
    """Return fields that Foxglove cannot read: it needs a simple type per field, and the properties of each object."""
    if schema["type"] == "object":
        if schema.get("additionalProperties") is not False:
            return [path]
        path_lists = (
            find_unsupported_fields(field_schema, f"{path}.{name}")
            for name, field_schema in schema["properties"].items()
        )
        return [name for inner_paths in path_lists for name in inner_paths]
    kind = schema["items"]["type"] if schema["type"] == "array" else schema["type"]
    return [] if kind in ("boolean", "string", "number", "integer") else [path]


def test_the_schemas_describe_every_field_of_every_message(long_run: Path) -> None:
    with long_run.open("rb") as stream:
        reader = make_reader(stream)
        for schema, _, message in reader.iter_messages():
            assert schema is not None
            jsonschema.Draft202012Validator(json.loads(schema.data)).validate(json.loads(message.data))
        summary = reader.get_summary()
    assert summary is not None
    for schema in summary.schemas.values():
        described = json.loads(schema.data)
        jsonschema.Draft202012Validator.check_schema(described)
        assert schema.encoding == "jsonschema"
        assert find_undescribed_fields(described, schema.name) == []
        assert find_unsupported_fields(described, schema.name) == []
    assert {channel.message_encoding for channel in summary.channels.values()} == {"json"}


def test_unknown_values_are_left_out_and_infinity_is_kept(tmp_path: Path) -> None:
    model = forest([given("size", type=real(unit="m")), given("count", type=integer()), given("word", type=text())])
    journal = Journal(tmp_path / "run.mcap")
    with ContextManager[str, str](model, clock=SimClock(), resources={"world": World()}, record=journal) as manager:
        manager.set("size", float("inf"))
        manager.set("size", float("nan"))
        manager.set("count", 2**63 - 1)
        manager.set("word", "Tür\n\u2028")
    _, events = read(journal.path)

    values = [(event.name, event.details.get("value")) for event in events if event.kind is Kind.VARIABLE]
    assert values == [("size", float("inf")), ("size", None), ("count", 2**63 - 1), ("word", "Tür\n\u2028")]
    contents = [content for topic, content, *_ in messages(journal.path) if topic == "/codra/context/size"]
    assert ("value" in contents[0], contents[0]["infinite"]) == (False, 1)
    assert ("value" in contents[1], contents[1]["reason"]) == (False, "rejected")


def test_the_log_time_is_the_instant_and_the_publish_time_that_of_the_evidence(tmp_path: Path) -> None:
    run_door(tmp_path / "run.mcap")

    for topic, content, log_ns, publish_ns in messages(tmp_path / "run.mcap")[1:]:
        assert log_ns == round(content["instant_s"] * 1e9)
        evidence_s = content.get("evidence_s") if topic.startswith(("/codra/context", "/codra/perception")) else None
        taken_s = evidence_s[-1] if isinstance(evidence_s, list) else evidence_s
        assert publish_ns == (log_ns if taken_s is None else round(taken_s * 1e9))
        if topic == "/codra/context/open" and content["source"] == "look":
            assert publish_ns < log_ns


def test_instants_before_zero_are_zero_in_mcap_and_kept_in_events(tmp_path: Path) -> None:
    run_door(tmp_path / "run.mcap", loops=1, start_s=-5.0)
    _, events = read(tmp_path / "run.mcap")

    assert events[0].instant_s == -5.0
    assert messages(tmp_path / "run.mcap")[1][2] == 0


def test_the_header_describes_the_run(tmp_path: Path) -> None:
    run_door(tmp_path / "run.mcap", seed=7, start_s=100.0)
    with (tmp_path / "run.mcap").open("rb") as stream:
        (metadata,) = make_reader(stream).iter_metadata()
    header, _ = read(tmp_path / "run.mcap")

    assert metadata.name == "codra-journal"
    assert {"spec": "door", "seed": "7", "start_s": "100.0"}.items() <= metadata.metadata.items()
    assert (header.spec, header.seed, header.start_s, header.model) == ("door", 7, 100.0, "")
    assert messages(tmp_path / "run.mcap")[0][1] == header.to_data()


def test_units_labels_and_members_are_metadata_of_the_topic(tmp_path: Path) -> None:
    model = forest(
        [
            given("light", type=real(0, 9, unit="lux"), label="Licht", valid_for_s=60.0),
            given("mode", type=member("idle", "busy")),
        ]
    )
    journal = Journal(tmp_path / "run.mcap")
    with ContextManager[str, str](model, clock=SimClock(), resources={"world": World()}, record=journal) as manager:
        manager.set("light", 3.0)
        manager.set("mode", "idle")
    with journal.path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None

    metadata_by_topic = {channel.topic: channel.metadata for channel in summary.channels.values()}
    assert metadata_by_topic["/codra/context/light"] == {"label": "Licht", "unit": "lux", "valid_for_s": "60"}
    assert metadata_by_topic["/codra/context/mode"] == {"values": "idle, busy"}


def test_messages_are_in_compressed_chunks_with_an_index(long_run: Path) -> None:
    all_records = records(long_run)

    chunks = [record for record in all_records if isinstance(record, Chunk)]
    assert len(chunks) > 3
    assert {chunk.compression for chunk in chunks} == {"zstd"}
    assert all(chunk.uncompressed_size <= CHUNK_BYTES for chunk in chunks)
    with long_run.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert len(summary.chunk_indexes) == len(chunks)


# The same run, the same bytes


def test_equal_seeds_give_equal_bytes(tmp_path: Path) -> None:
    first, second, other = (run_door(tmp_path / name, seed=seed).path for name, seed in (("a", 3), ("b", 3), ("c", 4)))

    assert first.read_bytes() == second.read_bytes() != other.read_bytes()


def test_equal_seeds_give_equal_bytes_in_processes_of_other_hash_seeds(tmp_path: Path) -> None:
    imports_text = "import sys; from pathlib import Path; from tests.runtime.journal.journals import run_door"
    program = f"{imports_text}; run_door(Path(sys.argv[1]))"
    for seed in "12":
        environment = {"PYTHONHASHSEED": seed, "PYTHONPATH": str(ROOT)}
        subprocess.run([sys.executable, "-c", program, tmp_path / seed], env=environment, check=True)

    assert (tmp_path / "1").read_bytes() == (tmp_path / "2").read_bytes()


# After a process was killed


def finished_after(events: list[Event], path: Path) -> bytes:
    """Return the content of the journal of a run that ended right after some events."""
    journal = Journal(path)
    header, _ = read(path.parent / "whole.mcap")
    journal.begin(lambda: header)
    for event in events:
        journal.add(event)
    journal.end()
    return path.read_bytes()


def test_a_recovered_journal_equals_one_that_was_finished_then(tmp_path: Path) -> None:
    run_door(tmp_path / "whole.mcap", loops=8)
    header, events = read(tmp_path / "whole.mcap")
    for event_count in (0, 1, 40, 300, len(events) - 1):
        torn_journal = Journal(tmp_path / "torn.mcap")
        torn_journal.begin(lambda: header)
        for event in events[:event_count]:
            torn_journal.add(event)
        unfinished_path = tmp_path / "dead.mcap"
        unfinished_path.write_bytes(torn_journal.path.read_bytes())  # what another process reads now
        torn_journal.end()

        recovery = recover(unfinished_path, tmp_path / "recovered.mcap")
        assert (recovery.message_count, recovery.damage.is_torn, recovery.damage.unreadable_parts) == (
            event_count + 1,
            True,
            [],
        )
        assert (tmp_path / "recovered.mcap").read_bytes() == finished_after(
            events[:event_count], tmp_path / "again.mcap"
        )


def test_a_torn_journal_is_read_without_recovery(tmp_path: Path) -> None:
    complete_journal_path = run_door(tmp_path / "run.mcap").path
    (tmp_path / "torn.mcap").write_bytes(complete_journal_path.read_bytes()[:-1])

    with JournalReader(tmp_path / "torn.mcap") as reader:
        assert list(reader.events()) == read(complete_journal_path)[1]
        assert reader.damage.is_torn


@drawn(share=st.floats(0.0, 1.0))
@settings(max_examples=40)
def test_a_journal_that_is_cut_anywhere_keeps_its_complete_chunks(
    complete_journal: CompleteJournal, share: float
) -> None:
    content = complete_journal.path.read_bytes()
    cut_content = content[: int(share * len(content))]
    torn_journal_path = complete_journal.path.with_name("cut.mcap")
    torn_journal_path.write_bytes(cut_content)
    try:
        with JournalReader(torn_journal_path) as reader:
            reader.header()
            kept_events = list(reader.events())
    except JournalError:
        assert len(cut_content) < CHUNK_BYTES
        return
    assert kept_events == complete_journal.events[: len(kept_events)]
    assert len(kept_events) >= len(complete_journal.events) * (len(cut_content) - 2 * CHUNK_BYTES) / len(content) - 1500


@drawn(place=st.floats(0.0, 1.0), byte=st.integers(0, 255))
@settings(max_examples=40)
def test_a_changed_byte_damages_its_chunk_only_and_never_crashes(
    complete_journal: CompleteJournal, place: float, byte: int
) -> None:
    content = bytearray(complete_journal.path.read_bytes())
    content[int(place * (len(content) - 1))] = byte
    damaged_journal_path = complete_journal.path.with_name("damaged.mcap")
    damaged_journal_path.write_bytes(content)
    try:
        with JournalReader(damaged_journal_path) as reader:
            reader.header()
            event_texts = set(map(Event.as_json, reader.events()))
    except JournalError:
        return
    assert event_texts <= complete_journal.event_texts
    assert event_texts == complete_journal.event_texts or reader.damage.unreadable_parts or reader.damage.is_torn


@drawn(data=st.data(), edit=st.sampled_from(["change", "cut out", "put in"]))
@settings(max_examples=50)
def test_a_damaged_start_is_reported_and_never_misread(
    complete_journal: CompleteJournal, data: st.DataObject, edit: str
) -> None:
    content = bytearray(complete_journal.path.read_bytes()[:300_000])
    end = content.index(bytes([OPEN_CHUNK_OPCODE]) + CHUNK_BYTES.to_bytes(8, "little"))
    position = data.draw(st.integers(0, end - 1))
    if edit == "change":
        content[position] = data.draw(st.integers(0, 255))
    elif edit == "cut out":
        del content[position : position + data.draw(st.integers(1, 60))]
    else:
        content[position:position] = data.draw(st.binary(min_size=1, max_size=60))
    damaged_journal_path = complete_journal.path.with_name("start.mcap")
    damaged_journal_path.write_bytes(content)
    try:
        with JournalReader(damaged_journal_path) as reader:
            summary = reader.header().summary
    except JournalError:
        return
    with JournalReader(complete_journal.path) as reader:
        assert summary == reader.header().summary


def test_an_unreadable_chunk_is_reported_with_the_lost_messages(long_run: Path, tmp_path: Path) -> None:
    content = bytearray(long_run.read_bytes())
    second_chunk = [record for record in records(long_run) if isinstance(record, Chunk)][1]
    position = bytes(content).index(second_chunk.data) + len(second_chunk.data) // 2
    content[position] ^= 0xFF
    (tmp_path / "damaged.mcap").write_bytes(content)

    recovery = recover(tmp_path / "damaged.mcap", tmp_path / "recovered.mcap")
    message_count = len(messages(long_run))
    assert recovery.damage.lost_message_count == message_count - recovery.message_count > 0
    assert "the chunk at byte" in recovery.damage.unreadable_parts[0]
    assert len(messages(tmp_path / "recovered.mcap")) == recovery.message_count


@pytest.mark.parametrize(
    "content", [b"", b"{}", b"\x89MCAP0\r\n", b"\x89MCAP0\r\n" + bytes(200), b"\x89MCAP0\r\n" + b"\xff" * 200]
)
def test_a_file_that_is_not_a_journal_is_reported(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "no.mcap").write_bytes(content)

    with pytest.raises(JournalError, match=r"no\.mcap is (empty|not an MCAP file|an MCAP file, but not a journal)"):
        recover(tmp_path / "no.mcap", tmp_path / "recovered.mcap")
    assert [path.name for path in tmp_path.iterdir()] == ["no.mcap"]


def test_an_event_that_is_larger_than_a_chunk_is_kept_at_once(tmp_path: Path) -> None:
    model = forest([given("word", type=text()), given("near")])
    journal = Journal(tmp_path / "run.mcap")
    with ContextManager[str, str](model, clock=SimClock(), resources={"world": World()}, record=journal) as manager:
        manager.set("near", True)
        for _ in range(3):
            journal.add(Event(0.0, Kind.VARIABLE, "word", "identified", {"value": "ü" * CHUNK_BYTES}))
            recover(journal.path, tmp_path / "recovered.mcap")
            assert len(messages(tmp_path / "recovered.mcap")[-1][1]["value"]) == CHUNK_BYTES
        manager.set("near", False)
        recover(journal.path, tmp_path / "recovered.mcap")
        assert messages(tmp_path / "recovered.mcap")[-1][1]["value"] is False


def test_the_region_of_the_open_chunk_is_empty_in_a_finished_journal(long_run: Path) -> None:
    content = long_run.read_bytes()
    position = content.index(bytes([OPEN_CHUNK_OPCODE]) + CHUNK_BYTES.to_bytes(8, "little")) + 9

    assert content[position : position + CHUNK_BYTES] == bytes(CHUNK_BYTES)


# Begin and end of the writer


def start(record: EventLog) -> ContextManager[str, str]:
    return ContextManager(MODEL, clock=SimClock(), resources={"door": Door()}, record=record)


def test_a_journal_belongs_to_one_run(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "run.mcap")
    with start(journal), pytest.raises(ValueError, match="is the journal of another run"):
        start(journal)
    with pytest.raises(ValueError, match="is the journal of another run"):
        start(journal)


def test_a_journal_whose_writer_was_killed_is_moved_aside_and_a_finished_one_replaced(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    run_door(path)
    run_door(path)
    assert [journal_file.name for journal_file in tmp_path.iterdir()] == ["run.mcap"]
    for _ in range(2):
        path.write_bytes(path.read_bytes()[:-1])
        run_door(path)
    assert sorted(journal_file.name for journal_file in tmp_path.iterdir()) == [
        "run.mcap",
        "run.unfinished-1.mcap",
        "run.unfinished-2.mcap",
    ]


def test_a_journal_that_cannot_be_created_raises_at_once(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        Journal(tmp_path / "missing/run.mcap")


ENDS_WITHOUT_CLOSE = """
import sys
from codra_dsl.runtime import ContextManager, Journal, SimClock
from tests.runtime.door import MODEL, Door
manager = ContextManager(MODEL, clock=SimClock(), resources={"door": Door()}, record=Journal(sys.argv[1]))
manager.set("localized", True)
"""

FORKS = """
import os, sys
from codra_dsl.runtime import ContextManager, Journal, SimClock
from tests.runtime.door import MODEL, Door
manager = ContextManager(MODEL, clock=SimClock(), resources={"door": Door()}, record=Journal(sys.argv[1]))
manager.set("localized", True)
if child := os.fork():
    assert os.waitpid(child, 0)[1] == 0
    manager.set("localized", False)
"""

FULL_DISK = """
import resource, sys
from codra_dsl.runtime import ContextManager, Journal, SimClock
from tests.runtime.door import MODEL, Door
resource.setrlimit(resource.RLIMIT_FSIZE, (90_000, 90_000))
journal, clock = Journal(sys.argv[1]), SimClock()
with ContextManager(MODEL, clock=clock, resources={"door": Door(angle_rad=1.0)}, record=journal) as manager:
    manager.set("localized", True)
    manager.declare("open")
    clock.sleep(3000.0)
    assert manager.get("open").value is True
print(journal.failure, len(journal))
"""

OFF = """
import sys
from codra_dsl.runtime import ContextManager, SimClock
from tests.runtime.door import MODEL, Door
with ContextManager(MODEL, clock=SimClock(), resources={"door": Door()}) as manager:
    manager.declare("localized", True)
print("mcap" in sys.modules, [event.kind for event in manager.record if event.kind == "input"])
"""


def run(program: str, path: Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return as_text(run_python(("-W", "error", "-c", program, str(path)), ROOT, environment))


def test_a_program_that_ends_without_closing_finishes_its_journal(tmp_path: Path) -> None:
    done = run(ENDS_WITHOUT_CLOSE, tmp_path / "run.mcap")

    assert (done.returncode, done.stderr) == (0, "")
    assert [topic for topic, *_ in messages(tmp_path / "run.mcap")] == [
        "/codra/run",
        "/codra/input",
        "/codra/context/localized",
    ]


def test_a_child_of_the_program_does_not_finish_the_journal(tmp_path: Path) -> None:
    done = run(FORKS, tmp_path / "run.mcap")

    assert (done.returncode, done.stderr) == (0, "")
    contents = [
        content for topic, content, *_ in messages(tmp_path / "run.mcap") if topic == "/codra/context/localized"
    ]
    assert [content["value"] for content in contents] == [True, False]


def test_numpy_numbers_are_written_as_numbers(tmp_path: Path) -> None:
    journal, clock = Journal(tmp_path / "run.mcap"), SimClock(10.0)
    with ContextManager[str, str](
        forest([given("size", type=real())]), clock=clock, resources={"world": World()}, record=journal
    ) as manager:
        manager.set("size", np.float32(0.5), evidence_s=np.float32(8.5))
        manager.decide("size", lambda: np.int64(3), max_age_s=np.float32(0.5), since_s=np.int32(9))

    assert journal.failure is None
    contents = [content for topic, content, *_ in messages(journal.path) if topic == "/codra/input"]
    assert contents[0]["evidence_s"] == [8.5]
    assert (contents[1]["max_age_s"], contents[1]["since_s"], contents[2]["value"]) == (
        0.5,
        9.0,
        "3.0",
    )


def test_a_full_disk_ends_the_journal_and_not_the_run(tmp_path: Path) -> None:
    done = run(FULL_DISK, tmp_path / "run.mcap")

    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("OSError: [Errno 27] File too large ")
    assert done.stderr.count("ends here: OSError") == 1
    assert "Traceback" not in done.stderr
    recovery = recover(tmp_path / "run.mcap", tmp_path / "recovered.mcap")
    assert len(messages(tmp_path / "recovered.mcap")) == recovery.message_count > 100


def test_without_a_journal_there_are_no_inputs_and_mcap_is_not_imported(tmp_path: Path) -> None:
    command = [sys.executable, "-W", "error", "-c", OFF, str(tmp_path)]  # a new process has imported nothing yet
    environment = {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, env=environment, check=False, text=True, stdout=subprocess.PIPE)

    assert done.stdout == "False []\n"
