"""One writer that is killed at a random instant, and the content of its journal."""

from __future__ import annotations

import json
import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path
from random import Random

from mcap.reader import make_reader

from codra_dsl.runtime import ContextManager
from codra_dsl.runtime.journal.reader import JournalError, JournalReader
from codra_dsl.runtime.journal.recovery import recover
from codra_dsl.runtime.replay import replay
from tests.campaigns.kills.writer import ACKNOWLEDGED_BYTES, model, write

LONGEST_S = 0.25
MOST_ROUNDS = 150


@dataclass(frozen=True)
class Outcome:
    """The result of a trial.

    Attributes:
        acknowledged: the last write that the writer acknowledged before it died; None if it had not begun.
        written: the last write in the recovered journal; None if the journal could not be recovered.
        messages: the number of recovered messages.
        torn: whether the journal lacked its end.
        mistakes: descriptions of the mistakes.
    """

    acknowledged: int | None
    written: int | None
    messages: int
    torn: bool
    mistakes: tuple[str, ...]


def trial(folder: Path, chance: Random) -> Outcome:
    """Let a writer write, kill it, recover its journal and check it. The process must have no other threads."""
    path, target = folder / "killed.mcap", folder / "recovered.mcap"
    for old in folder.iterdir():
        old.unlink()
    reads, writes = os.pipe()
    rounds = chance.randint(1, MOST_ROUNDS)
    writer = os.fork()
    if writer == 0:
        try:
            write(path, writes, rounds)
        finally:
            os._exit(0)
    os.close(writes)
    time.sleep(chance.random() * LONGEST_S)
    os.kill(writer, signal.SIGKILL)
    os.waitpid(writer, 0)
    acknowledged = _last_acknowledged(reads)
    try:
        torn = recover(path, target).damage.is_torn
    except (JournalError, FileNotFoundError) as error:
        mistakes = () if acknowledged is None else (f"the journal was not recovered: {error}",)
        return Outcome(acknowledged, None, 0, True, mistakes)
    return _judged(target, acknowledged, torn)


def _last_acknowledged(reads: int) -> int | None:
    with os.fdopen(reads, "rb") as pipe:
        acknowledgements = pipe.read()
    end = len(acknowledgements) // ACKNOWLEDGED_BYTES * ACKNOWLEDGED_BYTES
    return int.from_bytes(acknowledgements[end - ACKNOWLEDGED_BYTES : end]) if end else None


def _judged(target: Path, acknowledged: int | None, torn: bool) -> Outcome:
    mistakes = []
    with target.open("rb") as stream:
        mcap_records = make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False)
        messages = [(channel.topic, message) for _, channel, message in mcap_records]
    counts = [json.loads(message.data)["value"] for topic, message in messages if topic == "/codra/context/count"]
    written = counts[-1] if counts else 0
    if [message.sequence for _, message in messages] != list(range(1, len(messages) + 1)):
        mistakes.append("messages are missing in between")
    if counts != list(range(1, written + 1)):
        mistakes.append(f"writes are missing: {counts}")
    if acknowledged is not None and written < acknowledged:
        mistakes.append(f"{acknowledged} was acknowledged, {written} is the last in the journal")
    with JournalReader(target) as reader:
        header, events = reader.header(), list(reader.events())
    difference = replay(header, events, model(), ContextManager, None).difference
    if difference is not None:
        mistakes.append(f"its replay differs: {difference}")
    return Outcome(acknowledged, written, len(messages), torn, tuple(mistakes))
