"""The header of a journal: the compiled spec that a run used."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from codra_dsl.runtime.journal import Kind
from codra_dsl.runtime.journal.run_header import RunHeader
from codra_dsl.runtime.journal.schemas import topic_metadata
from codra_dsl.runtime.journal.spec_summary import Place, SpecSummary
from tests.runtime.journal.journals import read, run_door


@pytest.fixture(scope="module")
def summary(tmp_path_factory: pytest.TempPathFactory) -> SpecSummary:
    path: Path = tmp_path_factory.mktemp("journal") / "run.mcap"
    run_door(path, loops=1)
    return read(path)[0].summary


def test_file_and_model_of_the_spec_are_those_of_the_manifest(summary: SpecSummary) -> None:
    manifest = {"spec": "specs/door.yaml", "model": "5e1f"}
    header = RunHeader.of_run(summary, manifest, seed=3, start_s=2.0)

    assert (header.spec, header.file, header.model) == ("door", "specs/door.yaml", "5e1f")
    assert (header.seed, header.start_s) == (3, 2.0)


def test_without_a_manifest_file_and_model_are_empty(summary: SpecSummary) -> None:
    header = RunHeader.of_run(summary, {}, seed=3, start_s=2.0)

    assert (header.file, header.model) == ("", "")


def test_the_topic_of_an_observer_names_its_place_in_the_spec(summary: SpecSummary) -> None:
    observer = replace(summary.observers["door_lid"], place=Place(file="specs/door.yaml", line=7))
    placed_summary = replace(summary, observers={**summary.observers, "door_lid": observer})

    assert topic_metadata(Kind.OBSERVER, "door_lid", placed_summary) == {"place": "specs/door.yaml:7"}
    assert topic_metadata(Kind.OBSERVER, "unknown", placed_summary) == {}
