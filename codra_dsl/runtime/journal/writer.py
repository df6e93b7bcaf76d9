"""Write a journal's events as messages of an MCAP file."""

from __future__ import annotations

import json
import os
import threading
from typing import BinaryIO

from codra_dsl.runtime.journal.encoding import json_text, message_of
from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.journal.fields import Field
from codra_dsl.runtime.journal.mcap_file import McapFile
from codra_dsl.runtime.journal.run_header import FORMAT, RunHeader
from codra_dsl.runtime.journal.schemas import RUN_TOPIC, TOPICS, about, run_schema, schema_of, topic_of
from codra_dsl.runtime.journal.spec_summary import SpecSummary
from codra_dsl.runtime.journal.spec_summary_data import summary_to_data

OUTLINE = "outline.json"

MOST_CHANNELS = 60_000
"""The maximum number of channels; MCAP allows 65,535."""

_LATEST_NS = 2**63 - 1


class TooManyTopicsError(OSError):
    """The events have more subjects than a file can have topics."""


class JournalWriter:
    """Writes the events of one run.

    It may be finished while another thread adds events, for example when the program ends; later events are left out.
    Events that a child process adds are left out too, because it has inherited the file but not the run.
    """

    def __init__(self, stream: BinaryIO, header: RunHeader) -> None:
        """Write the run header.

        Args:
            stream: an empty file.
            header: the run header.
        """
        plain = header.plain()
        summary = json.dumps(summary_to_data(header.summary), ensure_ascii=False, allow_nan=False).encode()
        metadata = {FORMAT: {key: str(value) for key, value in plain.items()}}
        self._file = McapFile(stream, metadata, {OUTLINE: summary})
        self._summary: SpecSummary = header.summary
        self._channels: dict[tuple[Kind, str], int] = {}
        self._schemas: dict[str, int] = {}
        self._written = 0
        self._process = os.getpid()
        self._turn = threading.RLock()  # reentrant, since a signal handler may call this object during a call
        self._is_finished = False
        channel = self._file.channel(RUN_TOPIC, self._schema(*run_schema()), {})
        self._write(channel, json_text(plain).encode(), header.start_s, header.start_s)

    def add(self, event: Event) -> None:
        """Write an event.

        Raises:
            OSError: if it cannot be written.
        """
        if os.getpid() != self._process:
            return
        with self._turn:
            if not self._is_finished:
                self._add(event)

    def finish(self) -> None:
        """Write the end of the file.

        Raises:
            OSError: if it cannot be written.
        """
        with self._turn:
            self._is_finished = True
            self._file.finish()

    def _add(self, event: Event) -> None:
        kind, details = event.kind, event.details
        topic = TOPICS[kind]
        key = (kind, "" if topic.is_shared else event.name)
        channel = self._channels.get(key)
        if channel is None:
            channel = self._channels[key] = self._open(kind, event.name)
        evidence_s = details.get("evidence_s") if topic.has_evidence_time else None
        taken_s = evidence_s[-1] if isinstance(evidence_s, (list, tuple)) and evidence_s else evidence_s
        self._write(channel, message_of(event), event.instant_s, taken_s if isinstance(taken_s, float) else None)

    def _open(self, kind: Kind, name: str) -> int:
        if len(self._channels) >= MOST_CHANNELS:
            raise TooManyTopicsError(f"more than {MOST_CHANNELS} variables, observers and algorithms had events")
        schema = self._schema(*schema_of(kind, name, self._summary))
        return self._file.channel(topic_of(kind, name), schema, about(kind, name, self._summary))

    def _schema(self, name: str, schema: Field) -> int:
        if name not in self._schemas:
            self._schemas[name] = self._file.schema(name, json.dumps(schema, ensure_ascii=False).encode())
        return self._schemas[name]

    def _write(self, channel: int, data: bytes, instant_s: float, evidence_s: float | None) -> None:
        self._written += 1
        log_ns = _nanoseconds(instant_s)
        publish_ns = log_ns if evidence_s is None else _nanoseconds(evidence_s)
        self._file.add(channel, log_ns, publish_ns, self._written & 0xFFFFFFFF, data)


def _nanoseconds(instant_s: float) -> int:
    """Return an instant in MCAP's time, which is in nanoseconds and has no negative values."""
    return round(instant_s * 1e9) if 0.0 < instant_s < _LATEST_NS / 1e9 else 0
