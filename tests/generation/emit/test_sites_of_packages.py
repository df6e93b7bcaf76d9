"""Packages of sites: the places in both files, and the handles that the site states."""

from __future__ import annotations

import json
from pathlib import Path

from codra_dsl.compiler import plan_paths
from codra_dsl.generation.build_plan import BuildPlan
from codra_dsl.generation.emit import emit
from codra_dsl.generation.emit.records import model_digest, sources_text
from codra_dsl.runtime.journal.spec_summary import Place, place_from_data
from tests.language.load.test_sites import SITE, SPEC, project, site_of


def plan_of(folder: Path, keys: str) -> BuildPlan:
    root = project(folder, site_of(keys))
    (plan,) = plan_paths([root / "specs"], root, sites=[root / SITE]).plans
    return plan


def places_of(plan: BuildPlan) -> dict[str, str]:
    """Return the places in `sources.json`, as `why` shows them."""
    places = {key: place_from_data(data) for key, data in json.loads(sources_text(plan)).items()}
    return {key.removeprefix("door/"): str(place) for key, place in places.items()}


def test_elements_and_conditions_have_their_places_in_both_files(tmp_path: Path) -> None:
    keys = (
        "context:\n  light: {valid_for: 2 min}\nperception:\n  look_at_south:\n"
        "    observable_when: [light > 50 lux]\nuse:\n  north: {limit: 4}\n"
    )
    places = places_of(plan_of(tmp_path, keys))
    look_line = SPEC.split("\n").index("      look_at_$(instance):") + 1
    south_line = SPEC.split("\n").index("  south: {template: door, angle: 30 deg}") + 1

    assert places["context/light"] == f"specs/parts/light.yaml:3 (changed at {SITE}:4)"
    assert places["context/door_near"] == "specs/door.yaml:5"
    assert places["perception/look_at_south"] == (
        f"specs/door.yaml:{look_line} (used at specs/door.yaml:{south_line}, changed at {SITE}:7)"
    )
    assert places["perception/look_at_south/observable_when/0"].startswith(f"{SITE}:7 (replaces specs/door.yaml:")
    assert places["perception/look_at_north/accept_when/0"].endswith(f", changed at {SITE}:9)")
    assert "changed" not in places["perception/look_at_south/accept_when/0"]


def test_the_digest_of_the_model_depends_on_values_and_handles_and_not_on_the_file_of_the_site(tmp_path: Path) -> None:
    digests = [
        model_digest(plan_of(tmp_path / str(number), keys))
        for number, keys in enumerate(
            [
                "",
                "# a comment\ncontext: {light: {valid_for: 1 min}}\n",
                "context: {light: {valid_for: 2 min}}\n",
                "resources: {camera: {call: cameras:Camera}}\n",
                "resources: {camera: {call: cameras:Camera, with: {height: 2 m}}}\n",
            ]
        )
    ]

    assert digests[0] == digests[1]
    assert len(set(digests[1:])) == 4


def test_the_package_names_the_site_and_declares_its_handles(tmp_path: Path) -> None:
    files = emit(plan_of(tmp_path, "resources: {camera: {call: cameras:Camera, with: {height: 120 cm}}}\n"))
    entry, manifest = files["door/__init__.py"], json.loads(files["door/manifest.json"])

    assert 'handle=HandleModel(call="cameras:Camera", parameters={"height": 1.2})' in entry
    assert f"Made by codra from specs/door.yaml and {SITE}; edits are lost." in entry
    assert (manifest["spec"], manifest["site"]) == ("specs/door.yaml", SITE)


def test_a_place_without_another_file_is_written_as_before() -> None:
    use = Place(file="specs/door.yaml", line=9)

    assert str(Place(file="specs/door.yaml", line=3)) == "specs/door.yaml:3"
    assert str(Place(file="specs/door.yaml", line=3, use=use)) == "specs/door.yaml:3 (used at specs/door.yaml:9)"
