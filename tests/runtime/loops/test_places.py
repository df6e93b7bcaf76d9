"""Places of loops, which are kept beside the generated code."""

from __future__ import annotations

from dataclasses import replace

from codra_dsl.runtime.journal.spec_summary import Place
from codra_dsl.runtime.loops.declarations import MapeModel
from codra_dsl.runtime.loops.places import with_places
from tests.runtime.loops.shop import COURSE, MAPE, METRICS_STAGE


def bare() -> MapeModel:
    """Return the shop's loops as generated code has them: without places."""
    rules = tuple(replace(rule, place="") for rule in METRICS_STAGE.rules)
    course = replace(COURSE, place="", always=tuple(replace(rule, place="") for rule in COURSE.always))
    return replace(MAPE, metrics=replace(METRICS_STAGE, rules=rules), courses=(course,))


def test_rules_are_counted_by_what_they_conclude() -> None:
    places = {
        "metric/safety/rules/1": Place(file="a.yaml", line=7),
        "metric/power_autonomy/rules/0": Place(file="a.yaml", line=9, use=Place(file="b.yaml", line=2)),
        "adaptation/course": Place(file="a.yaml", line=20),
        "adaptation/course/always/1": Place(file="a.yaml", line=22),
    }
    model = with_places(bare(), places)
    assert model.metrics is not None
    assert [rule.place for rule in model.metrics.rules] == ["", "a.yaml:7", "a.yaml:9 (used at b.yaml:2)", "", ""]
    assert (model.courses[0].place, [rule.place for rule in model.courses[0].always]) == (
        "a.yaml:20",
        ["", "a.yaml:22"],
    )


def test_a_place_that_is_declared_stays() -> None:
    model = with_places(MAPE, {"metric/safety/rules/0": Place(file="a.yaml", line=7)})
    assert model.metrics is not None
    assert model.metrics.rules[0].place == "specs/shop.yaml:1"
