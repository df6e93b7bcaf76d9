"""Specs of any size, flat, templated and expanded: chains of ten observers with two preconditions each.

The same number of variables always gives the same bytes. `flat` and `templated` have eight lines per variable, and
observers for five in six variables. `flat` writes every declaration. In `templated` each chain is a use of one
template, with arguments for its own values. `expanded` writes out these uses: it has the same meaning as `templated`,
without a template, in eleven lines per variable.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from itertools import pairwise
from pathlib import Path

OBSERVERS_PER_CHAIN = 10
"""The number of observers of a chain. Each of them waits for the previous observer."""

WRITTEN_PER_CHAIN = 2
"""The number of variables of a chain that the main execution writes."""

CHAINS_PER_FILE = 80

_HEAD = "codra: 1"
_TYPES = "{markers: {type: int, range: [0, 12]}, angle: {type: float, unit: rad}}"


def flat(variables: int, chains_per_file: int = CHAINS_PER_FILE) -> Mapping[str, str]:
    """Return the files of a flat spec, as a mapping from paths to texts: the spec itself, and parts with its chains."""
    return _files("flat", variables, _flat_part, chains_per_file=chains_per_file)


def flat_specs(variables: int, specs: int) -> Mapping[str, str]:
    """Return the files of several flat specs without parts, which have the chains of one flat spec in all."""
    chains = variables // (OBSERVERS_PER_CHAIN + WRITTEN_PER_CHAIN)
    limits = [chains * number // specs for number in range(specs + 1)]
    head = [_HEAD, "resources:", "  camera: {}", "  vision: {slots: 2}"]
    return {
        f"hall_{number:03}.yaml": _text([*head, f"name: hall_{number:03}", *_flat_part(range(first, last))])
        for number, (first, last) in enumerate(pairwise(limits))
    }


def templated(variables: int) -> Mapping[str, str]:
    """Return the files of a spec whose chains are uses of a template: the spec, the template, and parts with uses."""
    files = _files("templated", variables, _part_with_uses, "parts/bay.yaml")
    return {**files, "parts/bay.yaml": _text([_HEAD, *_template()])}


def expanded(variables: int) -> Mapping[str, str]:
    """Return the files of the spec of `templated`, with the declarations that the uses of the template stand for."""
    return _files("templated", variables, _expanded_part)


def write(files: Mapping[str, str], folder: Path) -> None:
    """Write files below a folder, which becomes the root of a project."""
    for path, text in {"pyproject.toml": "[tool.codra]\n", **files}.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, "utf-8")


def _files(
    name: str,
    variables: int,
    part: Callable[[range], Iterator[str]],
    *template_paths: str,
    chains_per_file: int = CHAINS_PER_FILE,
) -> dict[str, str]:
    """Return a spec and its parts. The spec itself contains the remaining variables, which are too few for a chain."""
    chains, remaining_variables = divmod(variables, OBSERVERS_PER_CHAIN + WRITTEN_PER_CHAIN)
    parts = [range(first, min(first + chains_per_file, chains)) for first in range(0, chains, chains_per_file)]
    paths = {f"parts/{name}_{chains.start:05}.yaml": chains for chains in parts}
    lines = [_HEAD, f"name: {name}", "include:", *(f"  - {path}" for path in (*template_paths, *paths))]
    lines += ["resources:", "  camera: {}", "  vision: {slots: 2}", "context:"]
    lines += [
        f"  hall_{number}_is_lit: {{type: bool, source: main_execution}}" for number in range(remaining_variables)
    ]
    lines += [
        "skills:",
        f"  enter: {{preview: [{', '.join(f'hall_{number}_is_lit' for number in range(remaining_variables))}]}}",
    ]
    spec = {f"{name}.yaml": _text(lines if remaining_variables else lines[:-3])}
    return spec | {path: _text([_HEAD, *part(chains)]) for path, chains in paths.items()}


def _text(lines: list[str]) -> str:
    return "\n".join(lines) + "\n"


def _bays(chains: range) -> Iterator[str]:
    return (f"bay_{chain:05}" for chain in chains)


def _preconditions(bay: str, number: int) -> tuple[str, str]:
    """Return the preconditions of a door: a light, and the previous door, or the place in front of the first door."""
    return f"{bay}_is_lit", f"{bay}_door_{number - 1}_open" if number else f"{bay}_is_near"


def _flat_part(chains: range) -> Iterator[str]:
    yield "context:"
    for bay in _bays(chains):
        yield f"  {bay}_is_lit: {{type: bool, source: main_execution, valid_for: 1 min}}"
        yield f"  {bay}_is_near: {{type: bool, source: main_execution, valid_for: 20 s}}"
        for number in range(OBSERVERS_PER_CHAIN):
            yield f"  {bay}_door_{number}_open: {{type: bool, valid_for: {number + 60} s}}"
    yield "perception:"
    for bay in _bays(chains):
        for number in range(OBSERVERS_PER_CHAIN):
            yield f"  find_{bay}_door_{number}:"
            yield "    call: robot.perception:find_door"
            yield "    uses: {camera: read, vision: slot}"
            yield f"    returns: {_TYPES}"
            yield "    observable_when:"
            yield from (f"      - {name}" for name in _preconditions(bay, number))
            yield f"    identifies: {{{bay}_door_{number}_open: angle > 0.{number + 1} rad}}"
    yield "skills:"
    for bay in _bays(chains):
        yield from _skills(bay)


_DOOR_PARAMETERS = {
    "title": ("str", "Door {number} of {bay}"),
    "valid": ("quantity", "{later} min"),
    "hinge": ("str", "left"),
    "width": ("quantity", "0.{later} m"),
    "angle": ("quantity", "0.{later} rad"),
    "least": ("int", "{later}"),
    "timeout": ("quantity", "{later} s"),
    "interval": ("quantity", "{later}00 ms"),
    "lit": ("bool", "true"),
}
"""Parameters of the template, one of each kind for every door, with their types and arguments."""


def _part_with_uses(chains: range) -> Iterator[str]:
    yield "use:"
    for bay in _bays(chains):
        yield f"  {bay}:"
        yield "    template: bay"
        for number in range(OBSERVERS_PER_CHAIN):
            for name in _DOOR_PARAMETERS:
                yield f"    {name}_{number}: {_argument(bay, name, number)}"


def _template() -> Iterator[str]:
    yield "templates:"
    yield "  bay:"
    yield "    parameters:"
    for number in range(OBSERVERS_PER_CHAIN):
        yield from (f"      {name}_{number}: {type_}" for name, (type_, _) in _DOOR_PARAMETERS.items())
    for section, declarations in _SECTIONS.items():
        yield f"    {section}:"
        yield from (f"    {line}" for line in declarations("$(instance)", lambda name, number: f"$({name}_{number})"))


def _expanded_part(chains: range) -> Iterator[str]:
    for section, declarations in _SECTIONS.items():
        yield f"{section}:"
        for bay in _bays(chains):
            yield from declarations(bay, partial(_argument, bay))


def _argument(bay: str, name: str, number: int) -> str:
    """Return the argument that the use of a bay gives to a parameter."""
    return _DOOR_PARAMETERS[name][1].format(number=number, later=number + 1, bay=bay)


def _context(bay: str, value: _Value) -> Iterator[str]:
    yield f"  {bay}_is_lit: {{type: bool, source: main_execution, valid_for: 1 min}}"
    yield f"  {bay}_is_near: {{type: bool, source: main_execution, valid_for: 20 s}}"
    for number in range(OBSERVERS_PER_CHAIN):
        valid_for, label = value("valid", number), value("title", number)
        yield f"  {bay}_door_{number}_open: {{type: bool, valid_for: {valid_for}, label: {label}}}"


def _perception(bay: str, value: _Value) -> Iterator[str]:
    for number in range(OBSERVERS_PER_CHAIN):
        arguments = ", ".join(f"{name}: {value(name, number)}" for name in ("hinge", "width", "lit"))
        yield f"  find_{bay}_door_{number}:"
        yield "    call: robot.perception:find_door"
        yield f"    with: {{{arguments}}}"
        yield "    uses: {camera: read, vision: slot}"
        yield f"    timeout: {value('timeout', number)}"
        yield f"    min_interval: {value('interval', number)}"
        yield f"    returns: {_TYPES}"
        yield "    observable_when:"
        yield from (f"      - {name}" for name in _preconditions(bay, number))
        yield f"    accept_when: [markers >= {value('least', number)}]"
        yield f"    identifies: {{{bay}_door_{number}_open: angle > {value('angle', number)}}}"


def _skills(bay: str, _: _Value | None = None) -> Iterator[str]:
    yield f"  pass_{bay}:"
    yield f"    preview: [{bay}_door_{OBSERVERS_PER_CHAIN - 1}_open]"
    yield f"    monitor: [{bay}_door_{OBSERVERS_PER_CHAIN - 1}_open, {bay}_door_{OBSERVERS_PER_CHAIN - 2}_open]"
    yield f"    changes: [{bay}_is_near]"


_Value = Callable[[str, int], str]
"""Returns the text for a parameter, given its name and the number of its door."""

_SECTIONS: Mapping[str, Callable[[str, _Value], Iterator[str]]] = {
    "context": _context,
    "perception": _perception,
    "skills": _skills,
}
"""For each section, the function that returns the declarations of a bay."""
