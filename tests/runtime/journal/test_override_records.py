"""Forged records of overrides: every command that reads a journal reports them in one line."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from mcap.opcode import Opcode

from codra_dsl.runtime import ContextManager, Journal, SimClock
from codra_dsl.runtime.journal.reader import JournalReader
from codra_dsl.runtime.values.model import integer
from tests.cli.test_commands import codra
from tests.runtime.forests import forest, variable
from tests.runtime.journal.test_limits import chunk_bytes, forged, record_bytes

MODEL = forest([variable("level", type=integer(0, 9), sources=("main_execution",))])
WRONG_FIELDS: Mapping[tuple[str, str], Mapping[str, tuple[object, ...]]] = {
    ("/codra/input", "override"): {
        "variable": ([], {}, None, 7),
        "for_s": ([], "x", None, True, 10**400),
        "detail": ([], None, 7),
        "step": ([], "x", None, 0.5, True),
        "value": (["[1]"], {}),
        "work": ([], {}, "x"),
    },
    ("/codra/input", "clear"): {"variable": ([], None), "step": ([], None)},
    ("/codra/override/level", "begun"): {
        "what": ([], "x", None),
        "value": ([], {}),
        "reason": ([], "x", 7),
        "detail": ([], None),
        "until_s": ([], "x", None, 10**400),
    },
    ("/codra/override/level", "cleared"): {"source": ([], None, 7), "value": ([],), "reason": ({},)},
}


@pytest.fixture(scope="module")
def journal(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path, clock = tmp_path_factory.mktemp("run") / "run.mcap", SimClock()
    with ContextManager[str, str](MODEL, clock=clock, resources={}, record=Journal(path)) as manager:
        manager.set("level", 1)
        manager.override("level", 3, for_s=5.0, reason="gauge broken")
        clock.sleep(1.0)
        manager.clear_override("level")
    return path


def forge(journal: Path, target: Path, topic: str, what: str, changes: Mapping[str, object]) -> Path:
    """Write a journal with other fields in the first event of a kind; a field that becomes None is left out."""
    records, channel_ids = b"", set[int]()
    with JournalReader(journal) as reader:
        for raw_message in reader.raw_messages():
            channel, message = raw_message.channel, raw_message.message
            fields: dict[str, Any] = json.loads(message.data)
            if (channel.topic, fields.get("what")) == (topic, what):
                fields = {key: field for key, field in {**fields, **changes}.items() if field is not None}
                topic = ""
            if channel.id not in channel_ids:
                channel_ids.add(channel.id)
                records += record_bytes(raw_message.schema) + record_bytes(channel)
            data = json.dumps(fields).encode()
            head = (
                Opcode.MESSAGE,
                22 + len(data),
                channel.id,
                message.sequence,
                message.log_time,
                message.publish_time,
            )
            records += struct.pack("<BQHIQQ", *head) + data
    assert not topic
    return forged(journal, target, chunk_bytes(records, ""))


@pytest.mark.parametrize(("record", "fields"), WRONG_FIELDS.items())
def test_a_record_of_an_override_with_a_wrong_field_cannot_be_read(
    journal: Path, tmp_path: Path, record: tuple[str, str], fields: Mapping[str, tuple[object, ...]]
) -> None:
    for key, wrong_fields in fields.items():
        for wrong_field in wrong_fields:
            with JournalReader(forge(journal, tmp_path / "run.mcap", *record, {key: wrong_field})) as reader:
                event_count = sum(1 for _ in reader.events())
                (part,) = reader.damage.unreadable_parts
            assert event_count == 6
            assert "of an override" in part or part.endswith("KeyError: 'what'")


def test_every_command_reports_a_forged_override_in_one_line(journal: Path, tmp_path: Path) -> None:
    (tmp_path / "shop.yaml").write_text(
        "codra: 1\nname: shop\ncontext:\n  level: {type: int, range: [0, 9], source: main_execution}\n"
    )
    forge(journal, tmp_path / "run.mcap", "/codra/input", "override", {"variable": []})
    forge(journal, tmp_path / "why.mcap", "/codra/override/level", "begun", {"until_s": 10**400})
    for arguments, part in (
        (("replay", "run.mcap", "--spec", "shop.yaml"), "'variable' of an override is a text, not []"),
        (("journal", "show", "run.mcap", "--kind", "input"), "'variable' of an override is a text, not []"),
        (("why", "level", "--journal", "why.mcap", "--at", "0.5"), "'until_s' of an override is a number, not 1000000"),
    ):
        process = codra(*arguments, cwd=tmp_path)
        (line,) = (line for line in process.stderr.splitlines() if "cannot be read" in line)
        assert part in line
        assert "Error" not in process.stdout + process.stderr
