"""The commands that the runner of GitHub Actions reads from a log, in the present form and in the older one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

UNESCAPED = {"%0D": "\r", "%0A": "\n", "%3A": ":", "%2C": ",", "%25": "%"}


@dataclass(frozen=True)
class Command:
    """A command in a line of the log."""

    name: str
    properties: Mapping[str, str]
    message: str


def unescaped(text: str) -> str:
    for escape, letter in UNESCAPED.items():
        text = text.replace(escape, letter)
    return text


def command_of(line: str) -> Command | None:
    """Return the command in a line: `::name key=value,key=value::message` at its beginning."""
    line = line.lstrip()
    if not line.startswith("::") or "::" not in line[2:]:
        return None
    head, _, message = line[2:].partition("::")
    name, _, properties = head.partition(" ")
    pairs = (pair.split("=", 1) for pair in properties.split(",") if pair)
    return Command(name, {key: unescaped(value) for key, value in pairs}, unescaped(message))


def read(log: str) -> tuple[list[Command], list[str]]:
    """Return the commands in a log, and its other lines."""
    read_lines = [(command_of(line), line) for line in log.split("\n")]
    assert not any("##[" in line for command, line in read_lines if command is None), "the runner's older commands"
    return [command for command, _ in read_lines if command], [line for command, line in read_lines if not command]
