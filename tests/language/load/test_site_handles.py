"""Checks of the classes and functions with which sites make handles; their modules are read and never imported."""

from __future__ import annotations

from pathlib import Path

import pytest

from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.language.load import load_spec

SPEC = """\
codra: 1
name: bench
context:
  clean: {type: bool}
resources:
  camera: {}
  laser: {}
perception:
  look:
    call: elsewhere.perception:look
    uses: {camera: read, laser: read}
    returns: {dirt: {type: float}}
    identifies: {clean: dirt < 3}
"""

MODULE = """\
from dataclasses import dataclass, field
from enum import Enum


class Camera:
    def __init__(self, address, *, clock, gain=1): ...

    @classmethod
    def from_file(cls, path): ...


@dataclass
class Laser:
    port: str
    beams: int = 360
    seen: list = field(default_factory=list)


def open_laser(port, clock): ...


class Plain: ...


class Color(Enum):
    RED = 1


@dataclass
class Odd:
    port: str
    open_port: bool = field(init=False)


class Twice:
    def __init__(self): ...


Twice = print
"""


def site_findings(root: Path, *resources: str) -> list[Diagnostic]:
    """Return the findings about a site with these lines under `resources`."""
    (root / "devices.py").write_text(MODULE)
    (root / "spec.yaml").write_text(SPEC)
    lines = "".join(f"  {resource}\n" for resource in resources)
    (root / "site.yaml").write_text(f"codra: 1\noverlays: bench\nresources:\n{lines}")
    return list(load_spec(root / "spec.yaml", root, site=root / "site.yaml")[1])


@pytest.mark.parametrize(
    "maker",
    [
        "{call: devices:Camera, with: {address: a}}",
        "{call: devices:Camera, with: {address: a, gain: 2, clock: 3}}",
        "{call: devices:Camera.from_file, with: {anything: 1}}",
        "{call: devices:Laser, with: {port: a}}",
        "{call: devices:Laser, with: {port: a, beams: 90}}",
        "{call: devices:open_laser, with: {port: a}}",
        "{call: devices:Plain}",
        "{call: devices:Color, with: {value: 1}}",
        "{call: devices:Odd, with: {anything: 1}}",
        "{call: devices:Twice, with: {anything: 1}}",
        "{call: devices:dataclass, with: {anything: 1}}",
        "{call: installed.cameras:Camera, with: {anything: 1}}",
    ],
)
def test_a_handle_whose_maker_takes_its_arguments_or_is_uncertain_has_no_finding(tmp_path: Path, maker: str) -> None:
    assert site_findings(tmp_path, f"camera: {maker}") == []


@pytest.mark.parametrize(
    ("maker", "message", "help_text"),
    [
        (
            "{call: devices:Camra}",
            "module 'devices' has no function 'Camra', but resource 'camera' calls it",
            "did you mean 'Camera'?",
        ),
        (
            "{call: devies:Camera}",
            "module 'devies', which resource 'camera' calls, is not in this project",
            "did you mean 'devices'?",
        ),
        (
            "{call: devices:Camera, with: {adress: a}}",
            "function 'devices:Camera' does not take the argument 'adress', but resource 'camera' gives it",
            "did you mean 'address'?",
        ),
        (
            "{call: devices:Camera}",
            "function 'devices:Camera' needs an argument 'address', but resource 'camera' does not give it",
            "add 'address' under 'with', or give the parameter a default value",
        ),
        (
            "{call: devices:Laser, with: {port: a, lens: 90, rate: 5}}",
            "function 'devices:Laser' does not take the arguments 'lens', 'rate', but resource 'camera' gives them",
            "the function takes 'beams', 'port', 'seen'",
        ),
        (
            "{call: devices:Plain, with: {port: a}}",
            "function 'devices:Plain' does not take the argument 'port', but resource 'camera' gives it",
            "the function takes no arguments",
        ),
    ],
)
def test_a_wrong_maker_of_a_handle_is_reported_at_its_place_in_the_site(
    tmp_path: Path, maker: str, message: str, help_text: str
) -> None:
    (finding,) = site_findings(tmp_path, f"camera: {maker}")
    assert (finding.message, finding.help) == (message, help_text)
    assert (finding.place.span.file, finding.place.span.line) == ("site.yaml", 4)


def test_the_place_of_a_wrong_argument_is_its_name_in_the_site(tmp_path: Path) -> None:
    (finding,) = site_findings(tmp_path, "laser: {call: devices:open_laser, with: {port: a, prot: b}}")
    assert finding.place.span.column == "  laser: {call: devices:open_laser, with: {port: a, prot".index("prot") + 1


def test_the_result_depends_on_the_module_of_a_handle(tmp_path: Path) -> None:
    site_findings(tmp_path, "camera: {call: devices:Plain}")
    spec, _ = load_spec(tmp_path / "spec.yaml", tmp_path, site=tmp_path / "site.yaml")
    assert spec is not None
    assert "devices.py" in spec.modules


def test_a_handle_of_a_resource_that_does_not_exist_or_has_slots_has_one_finding(tmp_path: Path) -> None:
    (finding,) = site_findings(tmp_path, "camra: {call: devices:Camra}")
    assert finding.rule.name == "not-in-spec"
