"""Properties of random engines."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.language.fuzzy import read_fll, write_fll
from codra_dsl.language.fuzzy.check import engine_problems
from codra_dsl.language.fuzzy.model import Engine
from tests.language.fuzzy.engines import engine_of, loaded
from tests.language.fuzzy.random_engines import engines
from tests.language.fuzzy.test_bounds import assert_held, box_of, boxes, inside


@settings(max_examples=50, deadline=None)
@given(engine=engines(), drawn=boxes, points=inside)
def test_bounds_contain_every_value_of_any_engine(
    engine: Engine, drawn: list[tuple[float, float, bool]], points: list[list[float]]
) -> None:
    if not list(engine_problems(engine)):
        assert_held(loaded(engine), box_of(engine, drawn), points)


@settings(max_examples=40, deadline=None)
@given(engine=engines())
def test_any_written_engine_is_read_back(engine: Engine) -> None:
    text = write_fll(engine)
    if list(engine_problems(engine)):
        assert read_fll(text.encode(), "engine.fll").findings
    else:
        assert engine_of(text) == engine
        assert write_fll(engine_of(text)) == text


@settings(max_examples=40, deadline=None)
@given(
    engine=engines(),
    row=st.lists(st.sampled_from([float("nan"), float("inf"), float("-inf"), 0.3]), min_size=3, max_size=3),
)
def test_any_input_has_a_result(engine: Engine, row: list[float]) -> None:
    """Missing and infinite inputs have a result, and the bounds of unknown inputs have a result too."""
    if not list(engine_problems(engine)):
        module = loaded(engine)

        assert len(module.infer(*row).values) == len(module.OUTPUTS)
        assert len(module.infer_bounds(*module.RANGES).values) == len(module.OUTPUTS)
