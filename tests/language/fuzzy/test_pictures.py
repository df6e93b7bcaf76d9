"""Pictures of engines show their variables, terms and inferred values."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from codra_dsl.integrations.inspection.fuzzy_pictures import (
    draw_memberships,
    draw_surface,
    load_engine,
    membership_function,
    surface,
)
from codra_dsl.language.fuzzy.dialects import NUMBERS
from codra_dsl.language.fuzzy.shapes import membership
from codra_dsl.runtime.loops.fuzzy import formulas, terms
from tests.language.fuzzy.engines import NAMES, stored


def test_a_picture_of_memberships_names_every_variable_and_term(tmp_path: Path) -> None:
    engine = stored("store_metrics")
    draw_memberships(tmp_path / "terms.svg", engine)
    drawn = (tmp_path / "terms.svg").read_text("utf-8")

    for variable in engine.variables:
        assert f"<!-- {variable.name} -->" in drawn
        for term in variable.terms:
            assert f"<!-- {term.name} -->" in drawn


def test_the_same_engine_gives_the_same_picture(tmp_path: Path) -> None:
    engine = stored("store_metrics")
    for name in ("one", "other"):
        draw_surface(tmp_path / f"{name}.svg", engine, "safety", ("person_distance", "person_speed"))

    assert (tmp_path / "one.svg").read_bytes() == (tmp_path / "other.svg").read_bytes()


def test_the_corners_of_a_surface_are_the_inferred_values() -> None:
    engine = stored("store_metrics")
    fixed = {"battery": 50.0, "drain": 1.0, "load": 0.5, "progress": 0.5}
    heights = surface(engine, "safety", ("person_distance", "person_speed"), fixed)
    infer = load_engine(engine).infer

    for row, column, speed, distance in ((0, 0, 0.0, 0.0), (0, -1, 0.0, 10.0), (-1, 0, 3.0, 0.0), (-1, -1, 3.0, 10.0)):
        expected = infer(distance, speed, *fixed.values()).values[0]
        np.testing.assert_equal(heights[row, column], expected)


@pytest.mark.parametrize("name", NAMES)
def test_the_drawn_degrees_are_those_of_the_compiled_engine(name: str) -> None:
    modules, drawn_count = {"terms": terms, "formulas": formulas, "math": math}, 0
    for variable in stored(name).variables:
        for term in variable.terms:
            function = membership_function(term)
            if function is None:
                continue
            compiled = eval(f"lambda x: {membership(term, 'x', {}, [], NUMBERS)}", modules)
            for x in (-3.0, -0.5, 0.0, 0.3, 0.5, 0.75, 1.0, 2.0, 40.0):
                np.testing.assert_equal(function(x), compiled(x))
            drawn_count += 1
    assert drawn_count > 0
