"""The two arms of a spec, compiled but without a world."""

from __future__ import annotations

from pathlib import Path

import pytest

from codra_dsl.integrations.inspection import read_spec
from codra_dsl.runtime import SimClock
from codra_papers.experiments.lab.arms import NAIVE, NEED, observers
from codra_papers.experiments.lab.spec_variants import WithoutAlternatives

SPEC = """\
codra: 1
name: door
context:
  near: {type: bool, valid_for: 5 s}
  open: {type: bool, valid_for: 5 s}
perception:
  look_from_afar:
    call: builtins:print
    rank: 2
    returns: {gap: {type: float, unit: m, optional: true}}
    identifies: {open: gap > 40 cm}
  look:
    call: builtins:print
    returns: {gap: {type: float, unit: m, optional: true}}
    identifies: {near: gap > 41 cm, open: gap > 42 cm}
skills:
  pass_door: {preview: [near, open]}
"""


def modelled(text: str, folder: Path) -> list[tuple[str, ...]]:
    """Return the variables that each arm of a spec models."""
    folder.mkdir()
    (folder / "door.yaml").write_text(text)
    spec = read_spec(folder / "door.yaml")
    arms = [observers(arm, spec, folder / arm.name) for arm in (NEED, NAIVE)]
    return [arm.start(clock=SimClock(), resources={}).modelled() for arm in arms]


def test_both_arms_model_the_same_variables_also_with_alternative_algorithms(tmp_path: Path) -> None:
    assert modelled(SPEC, tmp_path / "one") == [("near", "open"), ("near", "open")]


def test_without_alternatives_each_variable_keeps_the_algorithm_of_the_lowest_rank(tmp_path: Path) -> None:
    (tmp_path / "door.yaml").write_text(SPEC)
    spec = read_spec(tmp_path / "door.yaml")

    assert [algorithm.name for algorithm in spec.perception] == ["look_from_afar", "look"]
    assert [algorithm.name for algorithm in WithoutAlternatives()(spec).perception] == ["look"]


@pytest.mark.parametrize("renamed", ["ajar", "wide"])
def test_a_spec_that_changed_under_its_name_is_loaded_again(tmp_path: Path, renamed: str) -> None:
    modelled(SPEC, tmp_path / "one")

    assert modelled(SPEC.replace("open", renamed), tmp_path / "two") == [("near", renamed)] * 2
