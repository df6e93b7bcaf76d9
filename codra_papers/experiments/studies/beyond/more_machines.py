"""Laboratories with more machines, and specs for them.

Such a spec is the spec under test with one more `use` line for each machine. The spec is written into the experiment's
folder whenever the experiment is run, so it cannot become outdated.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from math import pi
from pathlib import Path

from codra_dsl.integrations.inspection import SpecError, source_files
from codra_papers.lab.perception.layout import Machine, shaker
from codra_papers.lab.simulator.laboratory import LABORATORY

_USE_BLOCK = re.compile(r"^use:[ \t]*(?:#.*)?\n(?:[ \t]*(?:#.*)?\n)*(?P<indentation>[ ]+)(?=\S)", re.MULTILINE)

_CENTRIFUGE, _PCR_CYCLER = LABORATORY.machines

FURTHER_MACHINES: tuple[Machine, ...] = (
    shaker(5.3, 1.6, pi),
    _PCR_CYCLER.named("second_cycler", 40).at_place(3.5, 5.2, -pi / 2),
    _CENTRIFUGE.named("second_centrifuge", 50).at_place(5.3, 5.2, -pi / 2),
    shaker(0.7, 3.8, 0.0).named("left_shaker", 60),
    _PCR_CYCLER.named("third_cycler", 70).at_place(5.8, 3.3, pi),
    shaker(0.7, 1.5, 0.0).named("door_shaker", 80),
)
"""Machines at free places of the protocol's laboratory, which itself has two machines."""


def use_line(machine: Machine) -> str:
    """Return the line that adds a machine to a spec."""
    return f"{machine.name}: {{template: tended_machine, title: {machine.name}}}"


def spec_with(spec: Path, machines: Sequence[Machine], folder: Path) -> Path:
    """Write a spec with one more `use` line per machine, and copies of its parts. Return the path of the new spec.

    Args:
        spec: the spec under test.
        machines: the machines to add.
        folder: the folder for the new spec, which has the file name of `spec`. The folder is created.

    Raises:
        SpecError: if the spec has errors, or has no block of lines under `use`.
        OSError: if a file cannot be written.
    """
    spec_folder = spec.absolute().parent
    for part in source_files(spec):
        if part.is_relative_to(spec_folder) and part.is_file():
            copy = folder / part.relative_to(spec_folder)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(part.read_bytes())
    extended_spec = folder / spec.name
    extended_spec.write_text(_extended_text(spec.read_text(encoding="utf-8"), machines), encoding="utf-8")
    return extended_spec


def _extended_text(text: str, machines: Sequence[Machine]) -> str:
    match = _USE_BLOCK.search(text)
    if match is None:
        raise SpecError("the spec has no block of lines under 'use' to which machines can be added")
    lines = "".join(f"{use_line(machine)}\n{match['indentation']}" for machine in machines)
    return f"{text[: match.end()]}{lines}{text[match.end() :]}"
