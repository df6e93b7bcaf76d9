"""Write the events of a journal as messages of an MCAP file."""

from __future__ import annotations

import json
import os
import threading
from typing import BinaryIO

from codra_dsl.runtime.journal.encoding import json_text, message_of
from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.journal.fields import JsonSchema
from codra_dsl.runtime.journal.mcap_file import McapFile
from codra_dsl.runtime.journal.run_header import FORMAT, RunHeader
from codra_dsl.runtime.journal.schemas import RUN_TOPIC, TOPICS, run_schema, schema_of, topic_metadata, topic_of
from codra_dsl.runtime.journal.spec_summary import SpecSummary
from codra_dsl.runtime.journal.spec_summary_data import summary_to_data

SUMMARY_FILE = "outline.json"

MAX_CHANNELS = 60_000
"""The maximum number of channels; MCAP allows 65,535."""

_MAX_NS = 2**63 - 1


class TooManyTopicsError(OSError):
    """The events have more subjects than the number of topics that a file can have."""


class JournalWriter:
    """Writes the events of one run.

    A writer may be finished while another thread adds events, for example when the program ends; later events are not
    written. Events that a child process adds are not written either, because the child has inherited the file but not
    the run.
    """

    def __init__(self, stream: BinaryIO, header: RunHeader) -> None:
        """Write the run header.

        Args:
            stream: an empty file.
            header: the run header.
        """
        data = header.to_data()
        summary_json = json.dumps(summary_to_data(header.summary), ensure_ascii=False, allow_nan=False).encode()
        metadata = {FORMAT: {key: str(value) for key, value in data.items()}}
        self._file = McapFile(stream, metadata, {SUMMARY_FILE: summary_json})
        self._spec_summary: SpecSummary = header.summary
        self._channel_ids: dict[tuple[Kind, str], int] = {}
        self._schema_ids: dict[str, int] = {}
        self._message_count = 0
        self._writing_process_id = os.getpid()
        self._lock = threading.RLock()  # reentrant: during a call, a signal handler may call this object again
        self._is_finished = False
        channel_id = self._file.open_channel(RUN_TOPIC, self._ensure_schema(*run_schema()), {})
        self._write(channel_id, json_text(data).encode(), header.start_s, header.start_s)

    def add(self, event: Event) -> None:
        """Write an event.

        Raises:
            OSError: if the event cannot be written.
        """
        if os.getpid() != self._writing_process_id:
            return
        with self._lock:
            if not self._is_finished:
                self._add(event)

    def finish(self) -> None:
        """Write the end of the file.

        Raises:
            OSError: if the end cannot be written.
        """
        with self._lock:
            self._is_finished = True
            self._file.finish()

    def _add(self, event: Event) -> None:
        kind, details = event.kind, event.details
        topic = TOPICS[kind]
        key = (kind, "" if topic.is_shared else event.name)
        channel_id = self._channel_ids.get(key)
        if channel_id is None:
            channel_id = self._channel_ids[key] = self._open_channel(kind, event.name)
        evidence_s = details.get("evidence_s") if topic.has_evidence_time else None
        stamp_s = evidence_s[-1] if isinstance(evidence_s, (list, tuple)) and evidence_s else evidence_s
        self._write(channel_id, message_of(event), event.instant_s, stamp_s if isinstance(stamp_s, float) else None)

    def _open_channel(self, kind: Kind, name: str) -> int:
        if len(self._channel_ids) >= MAX_CHANNELS:
            raise TooManyTopicsError(f"more than {MAX_CHANNELS} variables, observers and algorithms had events")
        schema_id = self._ensure_schema(*schema_of(kind, name, self._spec_summary))
        return self._file.open_channel(topic_of(kind, name), schema_id, topic_metadata(kind, name, self._spec_summary))

    def _ensure_schema(self, name: str, schema: JsonSchema) -> int:
        if name not in self._schema_ids:
            self._schema_ids[name] = self._file.add_schema(name, json.dumps(schema, ensure_ascii=False).encode())
        return self._schema_ids[name]

    def _write(self, channel_id: int, data: bytes, instant_s: float, evidence_s: float | None) -> None:
        self._message_count += 1
        log_ns = _nanoseconds(instant_s)
        publish_ns = log_ns if evidence_s is None else _nanoseconds(evidence_s)
        self._file.add(channel_id, log_ns, publish_ns, self._message_count & 0xFFFFFFFF, data)


def _nanoseconds(instant_s: float) -> int:
    """Return an instant in nanoseconds, as MCAP stores it: negative and too large values become 0."""
    return round(instant_s * 1e9) if 0.0 < instant_s < _MAX_NS / 1e9 else 0
