"""One program to which signals are sent, and the content of its journal."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from random import Random

from mcap.reader import make_reader

from codra_dsl.runtime.journal import Event, Kind
from codra_dsl.runtime.journal.reader import Damage, JournalReader

ROOT = Path(__file__).parents[3]
PATIENCE_S = 120.0
CLOCKS = ("sim", "wall")
ATTACKS = ("interrupt", "terminate", "set", "raise")
LONGEST_RUN_S = 2.0


@dataclass(frozen=True)
class Outcome:
    """The result of a trial.

    Attributes:
        name: the clock and the attack, or the command.
        signals: the number of signals that arrived.
        acknowledged: the number of acknowledged writes.
        mistakes: descriptions of the mistakes.
    """

    name: str
    signals: int
    acknowledged: int
    mistakes: tuple[str, ...]


def writer_trial(path: Path, clock: str, attack: str, seed: int) -> Outcome:
    """Let a robot write its journal under an attack, and compare the journal with what was acknowledged."""
    name = f"{clock} {attack}"
    arguments = [str(path), clock, attack, str(seed)]
    command = [sys.executable, "-m", "tests.campaigns.signals.writer", *arguments]
    try:
        done = subprocess.run(command, cwd=ROOT, text=True, capture_output=True, timeout=PATIENCE_S, check=False)
    except subprocess.TimeoutExpired:
        return Outcome(name, 0, 0, (f"{name}, seed {seed}: the robot hangs",))
    if done.returncode:
        return Outcome(name, 0, 0, (f"{name}, seed {seed}: exit {done.returncode}: {done.stderr[-500:]}",))
    report = json.loads(done.stdout)
    events, damage = _read(path)
    written = {event.details["value"] for event in events if event.kind is Kind.VARIABLE}
    lost = [number for number in report["acknowledged"] if number not in written]
    mistakes = [f"{name}, seed {seed}: {mistake}" for mistake in _mistakes_of(path, damage, is_finished=True)]
    if lost and report["failure"] is None:
        mistakes.append(f"{name}, seed {seed}: {len(lost)} acknowledged writes are lost, the first is {lost[0]}")
    if report["failure"] is not None:
        mistakes.append(f"{name}, seed {seed}: the journal ended early: {report['failure']}")
    return Outcome(name, report["signals"], len(report["acknowledged"]), tuple(mistakes))


def command_trial(path: Path, attack: str, chance: Random) -> Outcome:
    """Send a signal to `codra run` at a random instant, and check the journal."""
    name = f"codra run {attack}"
    command = [sys.executable, "-m", "codra_dsl", "run", "specs/store.yaml", "--world", "store", "--for", "10 h"]
    with subprocess.Popen([*command, "--journal", str(path)], cwd=ROOT, stdout=-3, stderr=-3) as program:
        begin_s = time.monotonic()
        while not (path.exists() and path.stat().st_size) and time.monotonic() < begin_s + PATIENCE_S:
            time.sleep(0.05)
        time.sleep(chance.random() * LONGEST_RUN_S)
        program.send_signal(signal.SIGINT if attack == "interrupt" else signal.SIGTERM)
        try:
            program.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            program.kill()
            return Outcome(name, 1, 0, (f"{name}: the command hangs",))
    events, damage = _read(path)
    is_finished = attack == "interrupt"  # without a handler, SIGTERM ends a program like SIGKILL
    mistakes = [f"{name}: {mistake}" for mistake in _mistakes_of(path, damage, is_finished=is_finished)]
    return Outcome(name, 1, len(events), tuple(mistakes))


def _read(path: Path) -> tuple[list[Event], Damage]:
    with JournalReader(path) as reader:
        reader.header()
        return list(reader.events()), reader.damage


def _mistakes_of(path: Path, damage: Damage, *, is_finished: bool) -> list[str]:
    mistakes = [*damage.unreadable_parts] if is_finished else []
    if damage.lost_message_count:
        mistakes.append(f"{damage.lost_message_count} messages are missing")
    if damage.is_torn and is_finished:
        mistakes.append("the journal is not finished")
    if not damage.is_torn and not _opens_elsewhere(path):
        mistakes.append("another reader finds damage or misses messages")
    return mistakes


def _opens_elsewhere(path: Path) -> bool:
    """Return whether MCAP's own reader finds all messages."""
    try:
        with path.open("rb") as stream:
            found = list(make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False))
    except Exception:  # noqa: BLE001 - the reader raises many errors for damaged files
        return False
    return [message.sequence for *_, message in found] == list(range(1, len(found) + 1))
