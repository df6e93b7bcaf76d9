"""Shadow mode: how often context agrees with the robot's own looks, and when it does not."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from codra_dsl.cli.app import app
from codra_dsl.runtime import ContextManager, Journal, SimClock
from codra_dsl.runtime.context.shadow import Disagreement, shadow_report
from codra_dsl.runtime.replay import replay
from codra_dsl.runtime.values.model import SkillModel, real
from tests.runtime.forests import Manager, World, forest, given, observer, seen, started, variable
from tests.runtime.journal.journals import read

MODEL = forest(
    [variable("open", valid_for_s=5.0), given("weight", type=real(), valid_for_s=5.0)],
    observer("o", seen("look", "open")),
    skills=[SkillModel(name="pass", preview=("open",))],
)


def decide_in_shadow(manager: Manager, clock: SimClock, world: World) -> None:
    """Make six decisions on the door within a skill, and decisions on a weight outside of it."""
    manager.decide("open", lambda: False, shadow=True)
    with manager.skill("pass"):
        manager.decide("open", lambda: True, shadow=True)
        clock.sleep(0.5)
        for result in (True, True, False, None):
            assert manager.decide("open", lambda result=result: result, shadow=True) is result
        world.finds["look"] = {}
        clock.sleep(6.0)
        manager.decide("open", lambda: True, shadow=True)
    manager.set("weight", 1.0)
    for weight in (1.0, 1.25, 0.875):
        manager.decide("weight", lambda weight=weight: weight, shadow=True)
    clock.sleep(2.0)
    manager.decide("weight", lambda: 1.0, max_age_s=1.0, shadow=True)
    manager.decide("weight", lambda: 1.0)


def test_the_report_counts_the_agreements_per_variable_and_skill() -> None:
    clock, world = SimClock(), World({"look": {"seen": True}})
    with started(MODEL, world, clock) as manager:
        decide_in_shadow(manager, clock, world)
        report = manager.shadow_report()
    outside, door, weight = report.rows
    assert (outside.variable, outside.skill, outside.decisions, outside.agreement) == ("open", "", 1, None)
    assert (door.variable, door.skill, door.decisions) == ("open", "pass", 6)
    assert (door.agreed, door.compared, door.unseen) == (2, 3, 1)
    assert door.unknown == {"never_observed": 1, "rejected": 1}
    assert door.disagreements == (Disagreement(instant_s=0.5, held=True, seen=False, source="look"),)
    assert (weight.agreed, weight.compared, weight.largest_difference) == (1, 3, 0.25)
    assert weight.unknown == {"too_old": 1}


def test_the_report_is_readable_text() -> None:
    clock, world = SimClock(), World({"look": {"seen": True}})
    with started(MODEL, world, clock) as manager:
        assert str(manager.shadow_report()) == "no decision was taken in shadow mode"
        decide_in_shadow(manager, clock, world)
        text = str(manager.shadow_report())
    assert text.splitlines() == [
        "open: context agreed in 0 of 0",
        "  of 1 decisions: 1 in which context was never_observed",
        "open in pass: context agreed in 2 of 3 (67 %)",
        "  of 6 decisions: 1 in which the robot found nothing, 1 in which context was never_observed, "
        "1 in which context was rejected",
        "  0.5 s: context held true (look), the robot saw false",
        "weight: context agreed in 1 of 3 (33 %)",
        "  of 4 decisions: 1 in which context was too_old",
        "  differs by 0.25 at most",
        "  6.5 s: context held 1 (main_execution), the robot saw 1.25",
        "  6.5 s: context held 1 (main_execution), the robot saw 0.875",
    ]


def test_the_result_of_a_look_in_shadow_mode_is_not_kept() -> None:
    with started(MODEL, World()) as manager:
        manager.decide("weight", lambda: 1.0, shadow=True)
        assert not manager.get("weight").known


def test_a_look_that_raises_counts_as_a_decision_whether_context_had_an_answer_or_not() -> None:
    def looks() -> bool:
        raise ValueError("no picture")

    with started(forest([given("a")]), World()) as manager:
        for known in (False, True):
            if known:
                manager.set("a", value=True)
            with pytest.raises(ValueError, match="no picture"):
                manager.decide("a", looks, shadow=True)
        (row,) = manager.shadow_report().rows
    assert (row.decisions, row.unknown, row.unseen) == (2, {"never_observed": 1}, 1)


def a_journal(path: Path) -> ContextManager[Any, Any]:
    clock, world = SimClock(), World({"look": {"seen": True}})
    record = Journal(path)
    with ContextManager[str, str](MODEL, clock=clock, resources={"world": world}, record=record) as manager:
        decide_in_shadow(manager, clock, world)
    return manager


def test_a_journal_gives_the_same_report(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    manager = a_journal(path)
    header, events = read(path)
    assert shadow_report(events) == manager.shadow_report()
    assert replay(header, events, MODEL, ContextManager, None).difference is None

    result = CliRunner().invoke(app, ["shadow", str(path)])
    assert (result.exit_code, result.stdout) == (0, f"{manager.shadow_report()}\n")
    plain = json.loads(CliRunner().invoke(app, ["shadow", str(path), "--format", "json"]).stdout)
    assert [row["agreed"] for row in plain["rows"]] == [0, 2, 1]


def test_a_file_that_is_not_a_journal_is_refused(tmp_path: Path) -> None:
    other = tmp_path / "other.mcap"
    other.write_bytes(b"nothing")
    for path in (other, tmp_path / "absent.mcap"):
        result = CliRunner().invoke(app, ["shadow", str(path)])
        assert result.exit_code in (1, 2)
        assert "Traceback" not in result.output
