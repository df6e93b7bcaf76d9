"""A robot that is killed: its journal is recovered and replayed, also stripped, and also with an edited spec."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from random import Random

from mcap.reader import make_reader

from codra_dsl.runtime.journal import Event, Kind
from codra_dsl.runtime.journal.encoding import message_of
from codra_dsl.runtime.journal.mcap_file import ChannelDeclaration, McapFile
from codra_dsl.runtime.journal.reader import JournalReader
from codra_dsl.runtime.journal.schemas import kind_of
from tests.command_server import as_text, run_codra

ROOT = Path(__file__).parents[3]
LONGEST_S = 4.0
SPEC = "specs/kitchen.yaml"


@dataclass(frozen=True)
class RobotOutcome:
    """The result of a trial with a robot.

    Attributes:
        lived_s: from its first to its last event.
        lost_s: the missing time before the last instant that the robot printed; 0 if none is missing.
        messages: the number of recovered messages.
        edited: the line of the edited precondition, and the output of its replay.
        mistakes: descriptions of the mistakes.
    """

    lived_s: float
    lost_s: float
    messages: int
    edited: str
    mistakes: tuple[str, ...]


def robot_trial(folder: Path, chance: Random) -> RobotOutcome:
    """Let a robot work, kill it at a random instant, and check its journal."""
    killed, mended = folder / "killed.mcap", folder / "mended.mcap"
    last_printed_s = _killed(killed, chance)
    mistakes = [] if _codra("journal", "recover", str(killed), "--output", str(mended))[0] == 0 else ["not recovered"]
    with mended.open("rb") as stream:
        times = [message.log_time for *_, message in make_reader(stream, validate_crcs=True).iter_messages()]
    exit_code, output = _codra("replay", str(mended))
    if exit_code:
        mistakes.append(f"its replay differs: {output}")
    _strip(mended, folder / "stripped.mcap")
    exit_code, output = _codra("replay", str(folder / "stripped.mcap"), "--journal", str(folder / "again.mcap"))
    if exit_code or not _come_back(mended, folder / "stripped.mcap", folder / "again.mcap"):
        mistakes.append(f"variables and decisions are not derived again: {output}")
    edited, mistake = _edited(mended, folder, chance)
    lost_s = max(0.0, last_printed_s - times[-1] / 1e9)
    lived_s = (times[-1] - times[0]) / 1e9
    return RobotOutcome(lived_s, lost_s, len(times), edited, (*mistakes, *mistake))


def _killed(path: Path, chance: Random) -> float:
    """Let a robot work and kill it; return the last instant that it printed."""
    command = [sys.executable, "-m", "tests.campaigns.kills.robot", str(path), str(chance.randrange(1 << 30))]
    with subprocess.Popen(command, cwd=ROOT, text=True, stdout=subprocess.PIPE) as robot:
        assert robot.stdout is not None
        first = robot.stdout.readline()
        time.sleep(chance.random() * LONGEST_S)
        robot.kill()
        lines = [first, *robot.stdout.read().splitlines(keepends=True)]
    return float([line for line in lines if line.endswith("\n")][-1])


def _codra(*arguments: str, cwd: Path = ROOT) -> tuple[int, str]:
    done = as_text(run_codra(arguments, cwd, os.environ))
    return done.returncode, done.stdout + done.stderr


def _strip(path: Path, target: Path) -> None:
    """Write a journal without its variables and decisions."""
    with JournalReader(path) as reader, target.open("w+b") as stream:
        file, channels = McapFile(stream, reader.metadata, reader.files), dict[int, ChannelDeclaration]()
        for raw_message in reader.raw_messages():
            schema, channel, message = raw_message.schema, raw_message.channel, raw_message.message
            if kind_of(channel.topic) in (Kind.VARIABLE, Kind.DECISION):
                continue
            if channel.id not in channels:
                metadata = channel.metadata
                channels[channel.id] = ChannelDeclaration(channel.topic, schema.name, schema.data, metadata)
            file.add(channels[channel.id], message.log_time, message.publish_time, message.data, message.sequence)
        file.finish()


def _come_back(mended: Path, stripped: Path, again: Path) -> bool:
    """Return whether a replay of the stripped journal equals the journal, byte for byte.

    The robot is killed amid the consequences of one event. So one journal may hold some events at its end that the
    other does not, from the last instant of the stripped journal on.
    """
    last_instant_s = _events(stripped)[-1].instant_s
    recorded, derived = _events(mended), _events(again)
    common_length = min(len(recorded), len(derived))
    surplus = (*recorded[common_length:], *derived[common_length:])
    are_equal = [message_of(event) for event in recorded[:common_length]] == [
        message_of(event) for event in derived[:common_length]
    ]
    if not surplus:
        return mended.read_bytes() == again.read_bytes()
    return are_equal and all(event.instant_s >= last_instant_s for event in surplus)


def _events(path: Path) -> list[Event]:
    with JournalReader(path) as reader:
        return list(reader.events())


def _edited(path: Path, folder: Path, chance: Random) -> tuple[str, list[str]]:
    """Replay with a negated precondition of an algorithm that has looked; return a description of the edit."""
    with JournalReader(path) as reader:
        summary = reader.header().summary
        started_algorithms = {
            event.name for event in reader.events() if event.kind is Kind.JOB and event.what == "started"
        }
    rules = [
        rule
        for name in sorted(started_algorithms)
        for rule in summary.algorithms[name].preconditions
        if rule.place is not None
    ]
    stated_rules = [rule for rule in rules if rule.source_text and not rule.source_text.startswith("known(")]
    place = chance.choice([rule.place for rule in stated_rules])
    assert place is not None
    lines = (ROOT / SPEC).read_text().splitlines(keepends=True)
    before = lines[place.line - 1]
    lines[place.line - 1] = re.sub(r"- (.*)\n", r"- not (\1)\n", before)
    (folder / "specs").mkdir(exist_ok=True)
    (folder / "pyproject.toml").write_text("[tool.codra]\n")
    (folder / SPEC).write_text("".join(lines))
    exit_code, output = _codra("replay", str(path), "--spec", SPEC, cwd=folder)
    edited = f"line {place.line}, {before.strip()[2:]}: {output}"
    difference = re.search(
        r"^differs at event \d+, [-\d:. ]+ UTC: \w+ \w+( for [\w, ]+)?  \[specs/kitchen\.yaml:\d+", output, re.M
    )
    named = re.search(rf"the spec differs: \w+, observable_when: .*\[specs/kitchen\.yaml:{place.line}\b", output)
    return edited, [] if exit_code == 1 and difference and named else [f"the edit is not named: {edited}"]
