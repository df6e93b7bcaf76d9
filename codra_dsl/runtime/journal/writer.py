"""Write the events of a journal as messages of an MCAP file."""

from __future__ import annotations

import json
import os
from functools import lru_cache
from typing import BinaryIO

from codra_dsl.runtime.journal.encoding import json_text, message_of
from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.journal.fields import JsonSchema
from codra_dsl.runtime.journal.limits import MAX_MESSAGE_VALUES, MAX_RECORD_BYTES, MEBIBYTE, value_count
from codra_dsl.runtime.journal.mcap_file import ChannelDeclaration, McapFile
from codra_dsl.runtime.journal.run_header import FORMAT, RUN_TOPIC, RunHeader, run_schema
from codra_dsl.runtime.journal.schemas import TOPICS, schema_of, topic_metadata, topic_of
from codra_dsl.runtime.journal.spec_summary_data import summary_to_data

SUMMARY_FILE = "outline.json"

MAX_CHANNELS = 60_000
"""The maximum number of channels; MCAP allows 65,535."""

MAX_MESSAGE_BYTES = MAX_RECORD_BYTES - MEBIBYTE
"""The maximum size of a message; the rest of its chunk declares its channel."""

MAX_UNCHECKED_BYTES = MAX_MESSAGE_VALUES
"""A message of this size cannot exceed a limit, because each of its values has at least one byte."""

_MAX_NS = 2**63 - 1


class TooManyTopicsError(OSError):
    """The events have more subjects than the number of topics that a file can have."""


class TooLargeEventError(OSError):
    """An event is larger than readers accept."""


class JournalWriter:
    """Writes the events of one run.

    A writer may be finished while another thread adds events, for example when the program ends; later events are not
    written. Events that a child process adds are not written either, because the child has inherited the file but not
    the run.
    """

    def __init__(self, stream: BinaryIO, header: RunHeader) -> None:
        """Prepare the file.

        Args:
            stream: an empty file; the end of the journal closes it.
            header: the run header.
        """
        self._header = header
        self._stream = stream
        summary_json = json.dumps(summary_to_data(header.summary), ensure_ascii=False, allow_nan=False).encode()
        metadata = {FORMAT: {key: str(value) for key, value in header.to_data().items()}}
        self._file = McapFile(stream, metadata, {SUMMARY_FILE: summary_json})
        self._channels: dict[tuple[Kind, str], ChannelDeclaration] = {}
        self._writing_process_id = os.getpid()

    @property
    def failure(self) -> Exception | None:
        """Return the error that has ended the file early; None if there was none."""
        return self._file.failure

    @property
    def is_over(self) -> bool:
        """Return whether no event is written any more."""
        return self._file.is_over

    def write_header(self) -> None:
        """Write the run header.

        Raises:
            OSError: if the file cannot be written.
        """
        schema_name, schema = run_schema()
        channel = ChannelDeclaration(RUN_TOPIC, schema_name, _schema_text(schema), {})
        start_ns = _nanoseconds(self._header.start_s)
        self._file.add(channel, start_ns, start_ns, json_text(self._header.to_data()).encode())

    def add(self, event: Event) -> None:
        """Write an event.

        Raises:
            Exception: if the event cannot be encoded or written. Then `failure` is this error. Any other exception was
                raised by a signal handler.
        """
        if os.getpid() != self._writing_process_id:
            return
        try:
            message = self._encode(event)
        except Exception as error:
            if not self._can_encode(event):
                self._file.fail(error)
            raise
        self._file.add(*message)

    def finish(self) -> None:
        """Write the end of the file. In a child process, only close the file.

        Raises:
            OSError: if the end cannot be written.
        """
        if os.getpid() == self._writing_process_id:
            self._file.finish()
        else:
            self._stream.close()  # the lock of the file stays with the parent

    def _encode(self, event: Event) -> tuple[ChannelDeclaration, int, int, bytes]:
        """Return the message of an event: its channel, its times and its content. Nothing is written."""
        kind, details = event.kind, event.details
        topic = TOPICS[kind]
        key = (kind, "" if topic.is_shared else event.name)
        channel = self._channels.get(key) or self._channels.setdefault(key, self._declare(kind, event.name))
        log_ns = _nanoseconds(event.instant_s)
        evidence_s = details.get("evidence_s") if topic.has_evidence_time else None
        stamp_s = evidence_s[-1] if isinstance(evidence_s, (list, tuple)) and evidence_s else evidence_s
        publish_ns = _nanoseconds(stamp_s) if isinstance(stamp_s, float) else log_ns
        message = message_of(event)
        if len(message) > MAX_UNCHECKED_BYTES:
            _check_size(message)
        return channel, log_ns, publish_ns, message

    def _can_encode(self, event: Event) -> bool:
        """Return whether an event can be encoded. If it can, a signal handler raised an earlier error."""
        try:
            self._encode(event)
        except Exception:  # noqa: BLE001 - a handler may raise any error
            return False
        return True

    def _declare(self, kind: Kind, name: str) -> ChannelDeclaration:
        if len(self._channels) >= MAX_CHANNELS:
            raise TooManyTopicsError(f"more than {MAX_CHANNELS} variables, observers and algorithms had events")
        schema_name, schema = schema_of(kind, name, self._header.summary)
        metadata = topic_metadata(kind, name, self._header.summary)
        return ChannelDeclaration(topic_of(kind, name), schema_name, _schema_text(schema), metadata)


def _check_size(message: bytes) -> None:
    if len(message) > MAX_MESSAGE_BYTES or value_count(message) > MAX_MESSAGE_VALUES:
        raise TooLargeEventError(
            f"an event has {len(message):,} bytes and about {value_count(message):,} values: "
            f"readers accept {MAX_MESSAGE_BYTES:,} bytes and {MAX_MESSAGE_VALUES:,} values"
        )


def _schema_text(schema: JsonSchema) -> bytes:
    return json.dumps(schema, ensure_ascii=False).encode()


@lru_cache(maxsize=64)
def _nanoseconds(instant_s: float) -> int:
    """Return an instant in nanoseconds, as MCAP stores it: negative and too large values become 0.

    Many instants are repeated, because all events of a step have one instant.
    """
    return round(instant_s * 1e9) if 0.0 < instant_s < _MAX_NS / 1e9 else 0
