"""P2's situations as whole runs of specs/store.yaml: its loops and trees on its agents, checked by the journal."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from codra_dsl.runtime.journal import Event, Kind
from codra_papers.experiments.store.curves import curves, draw_adaptation
from codra_papers.experiments.store.run import CompiledSpec, StoreRun, StoreRunSettings, run_store, store_text
from codra_papers.store.simulator.situations import Situation, StoreSettings
from generated import store
from tests.cli.test_commands import ROOT, codra
from tests.runtime.journal.journals import read

LASTS_S = {
    Situation.ORDINARY: 150.0,
    Situation.SECOND_ORDER: 262.0,
    Situation.PEOPLE_CLOSE: 60.0,
    Situation.HIDDEN: 70.0,
    Situation.ABSENT: 88.0,
}
"""The duration of a run per situation, long enough for the seeds of the tests."""

BEGINNING_S = 20.0

TASKS = ("navigating", "detecting", "rotating", "checking", "lifting", "lowering", "fetching")


class RecordedRun:
    """A run and its journal."""

    def __init__(self, folder: Path, situation: Situation, seed: int, lasts_s: float) -> None:
        self.journal = folder / "run.mcap"
        settings = StoreRunSettings(
            shop=StoreSettings(seed=seed, situation=situation), duration_s=lasts_s, journal=self.journal
        )
        self.run: StoreRun = run_store(CompiledSpec.of(store), settings)
        self.events: list[Event] = list(read(self.journal)[1])

    def courses(self) -> list[str]:
        return [event.details["action"] for event in self.events if (event.name, event.what) == ("course", "chosen")]

    def task_results(self) -> list[str]:
        """The results of tasks, in order."""
        ends = [event for event in self.events if event.name in TASKS and event.what in ("finished", "aborted")]
        return [f"{event.name} {event.details.get('result') or event.what}" for event in ends]

    def written_values(self, name: str) -> list[object]:
        return [event.details.get("value") for event in self.events if (event.name, event.what) == (name, "written")]

    def values(self, variable: str) -> list[object]:
        """The values of a context-variable, in order."""
        variable_events = [event for event in self.events if event.kind is Kind.VARIABLE and event.name == variable]
        return [event.details["value"] for event in variable_events if "value" in event.details]

    def instant_s(self, name: str, what: str, **details: object) -> float:
        """The instant of the first matching event."""
        return next(
            event.instant_s
            for event in self.events
            if (event.name, event.what) == (name, what) and details.items() <= event.details.items()
        )


SEEDS = {
    Situation.ORDINARY: 3,
    Situation.SECOND_ORDER: 7,
    Situation.PEOPLE_CLOSE: 7,
    Situation.HIDDEN: 6,
    Situation.ABSENT: 3,
}
"""The seed of the run per situation; `make stores` runs others. In the ordinary run, a person stands in the way."""


class RecordedRuns:
    """Runs that several tests use, each made once."""

    def __init__(self, make_folder: Callable[[str], Path], seeds: Mapping[Situation, int]) -> None:
        self._make_folder = make_folder
        self._seeds = seeds
        self._runs: dict[tuple[Situation, float], RecordedRun] = {}

    def of(self, situation: Situation) -> RecordedRun:
        return self._run(situation, LASTS_S[situation])

    def beginning_of(self, situation: Situation) -> RecordedRun:
        """Return a run of `BEGINNING_S`."""
        return self._run(situation, BEGINNING_S)

    def _run(self, situation: Situation, lasts_s: float) -> RecordedRun:
        key = (situation, lasts_s)
        if key not in self._runs:
            self._runs[key] = RecordedRun(self._make_folder("run"), situation, self._seeds[situation], lasts_s)
        return self._runs[key]


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> RecordedRuns:
    return RecordedRuns(tmp_path_factory.mktemp, SEEDS)


def test_an_ordinary_order_is_delivered_and_counted_as_done(runs: RecordedRuns) -> None:
    run = runs.of(Situation.ORDINARY)

    assert store_text(run.run).startswith("150.0 s\norders              1 done\nmissions completed  1 (delivery)\n")
    assert run.written_values("order_1.state") == ["open", "done"]
    assert run.run.score.deliveries == ("delivery",)
    assert run.run.score.bumps == 0


def test_the_drain_of_the_battery_is_known_as_soon_as_readings_span_half_of_its_time(runs: RecordedRuns) -> None:
    run = runs.of(Situation.ORDINARY)
    autonomy = curves(run.events, ["power_autonomy"])["power_autonomy"]

    first_known_s = run.instant_s("battery_drain", "identified")
    assert 60.0 <= first_known_s <= 62.0
    assert max(value for at_s, value in autonomy if at_s < first_known_s) < 0.51 < autonomy[-1][1]
    assert [event.name for event in run.events if event.what == "never_known"] == []


def test_a_container_that_is_full_is_brought_to_the_general_delivery_pose_instead(runs: RecordedRuns) -> None:
    """P2's first situation: a container is provided, ordered elsewhere while people fill it, and full on the way."""
    run = runs.of(Situation.SECOND_ORDER)

    assert run.written_values("order_1.state")[-1] == "done"
    assert run.written_values("order_2.state")[-1] == "aborted"
    assert run.run.score.deliveries == ("area_1", "delivery")
    ordered_s = run.instant_s("order_2", "node_inserted")
    full_s = run.instant_s("container_load", "identified", value="full")
    fetched_s = [event.instant_s for event in run.events if event.details.get("result") == "fetched"]
    assert ordered_s < fetched_s[1] < full_s < run.instant_s("course", "chosen", action="deliver") < full_s + 5.0


def test_people_close_make_safety_fall_to_a_half_and_the_pick_up_is_aborted(runs: RecordedRuns) -> None:
    """P2's second situation: `start` weighs most. The order stays open."""
    run = runs.of(Situation.PEOPLE_CLOSE)
    values = curves(run.events, ["safety", *(f"weight_of_{action}" for action in ("pick", "deliver", "start", "dock"))])
    switched_s = [event.instant_s for event in run.events if (event.name, event.what) == ("course", "chosen")][-1]
    last_values = {name: [value for at_s, value in curve if at_s < switched_s][-1] for name, curve in values.items()}

    assert run.courses() == ["start", "pick", "start"]
    assert abs(last_values.pop("safety") - 0.5) < 0.01
    assert max(last_values, key=lambda name: last_values[name]) == "weight_of_start"
    assert "fetching aborted" in run.task_results()
    assert run.written_values("order_1.state") == ["open"]
    assert "mission_aborted" in run.values("base_notice")


def test_an_aborted_pick_up_is_tried_again_from_the_start_and_the_container_fetched_once_the_people_have_gone(
    tmp_path: Path,
) -> None:
    check_second_try(RecordedRun(tmp_path, Situation.PEOPLE_CLOSE, 6, 190.0))


def check_second_try(run: RecordedRun) -> None:
    task_results = run.task_results()

    assert (
        task_results.count("fetching aborted")
        == task_results[: task_results.index("fetching fetched")].count("fetching aborted")
        > 0
    )
    assert run.courses()[:4] == ["start", "pick", "start", "pick"]


def check_second_try_and_delivery(run: RecordedRun) -> None:
    check_second_try(run)
    assert run.written_values("order_1.state")[-1] == "done"
    assert run.run.score.deliveries == ("delivery",)


def test_a_container_that_is_hidden_from_the_first_pose_is_fetched_from_the_second(runs: RecordedRuns) -> None:
    task_results = runs.of(Situation.HIDDEN).task_results()

    assert [task_result for task_result in task_results if task_result.startswith("detecting")] == [
        *("detecting lost", "detecting found", "detecting found"),
    ]
    assert "fetching fetched" in task_results


def test_without_a_container_the_base_gets_a_notice_and_the_robot_returns(runs: RecordedRuns) -> None:
    run = runs.of(Situation.ABSENT)

    assert [task_result for task_result in run.task_results() if task_result.startswith(("detecting", "fetching"))] == [
        *("detecting lost", "detecting lost", "fetching not_found"),
    ]
    assert run.values("base_notice")[-1] == "container_not_found"
    assert run.written_values("order_1.state") == ["open", "failed"]
    assert run.task_results()[-1] == "navigating arrived"
    assert run.courses()[-1] == "start"


@pytest.mark.parametrize("situation", [Situation.SECOND_ORDER, Situation.PEOPLE_CLOSE])
def test_the_same_seed_begins_with_the_same_events_however_long_the_run(
    runs: RecordedRuns, situation: Situation
) -> None:
    events = runs.beginning_of(situation).events
    first_events = [event for event in runs.of(situation).events if event.instant_s < BEGINNING_S]

    assert [event for event in events if event.instant_s < BEGINNING_S] == first_events
    assert len(first_events) > 1000


def test_the_command_gives_the_same_journal_as_the_program_byte_for_byte(runs: RecordedRuns, tmp_path: Path) -> None:
    journal = tmp_path / "run.mcap"
    duration = f"{BEGINNING_S:g}s"
    words = (
        "specs/store.yaml",
        "--world",
        "store",
        "--situation",
        "people-close",
        "--seed",
        str(SEEDS[Situation.PEOPLE_CLOSE]),
        "--for",
        duration,
    )
    completed_process = codra("run", *words, "--journal", str(journal), cwd=ROOT)

    assert "orders              1 open" in completed_process.stdout
    assert journal.read_bytes() == runs.beginning_of(Situation.PEOPLE_CLOSE).journal.read_bytes()


def test_why_prints_the_chain_from_the_person_to_the_branch_and_the_counterfactual(runs: RecordedRuns) -> None:
    """Each link leads to the place of the rule in the spec."""
    journal = str(runs.of(Situation.PEOPLE_CLOSE).journal)
    explanation = codra("why", "course", "--journal", journal, cwd=ROOT).stdout

    for link in (
        "start was chosen at ",
        " instead of pick: ",
        "with a dwell time until ",
        "metric safety: 0.5",
        "is nobody and person_distance is close then safety is medium: activation 1  [specs/store.yaml:",
        "if safety is medium and crowding is persistent and loaded is false then weight_of_start is high: activation 1",
        "weight of start: 0.814285, smoothed ",
        "person_distance was 0.",
        "crowding was 0.7",
        "the branch pick ended (halted)",
        "pick would have been kept by crowding = 0.6",
        " or the weight of start = ",
    ):
        assert link in explanation


def test_why_of_a_metric_and_of_a_weight_prints_their_causes(runs: RecordedRuns) -> None:
    run = runs.of(Situation.PEOPLE_CLOSE)
    switched_s = [event.instant_s for event in run.events if (event.name, event.what) == ("course", "chosen")][-1]
    options = ("--journal", str(run.journal), "--at", str(switched_s - 0.01))
    of_metric, of_weight = (codra("why", name, *options, cwd=ROOT).stdout for name in ("safety", "weight_of_start"))

    for link in (
        "safety has been 0.5 since ",
        "is nobody and person_distance is close then safety is medium: activation 1  [specs/store.yaml:",
        "people_at_container was 0, from evidence taken at ",
        "person_distance was 0.",
        "(close 1)",
        "picking_up was true",
    ):
        assert link in of_metric
        assert link in of_weight
    assert "weight_of_start has been 0.814285 since " in of_weight
    assert "if safety is medium and crowding is persistent and loaded is false then weight_of_start" in of_weight
    assert "crowding was 0.7" in of_weight
    assert "safety was 0.5, from evidence taken at " in of_weight


def test_metrics_and_weights_are_drawn_over_time(runs: RecordedRuns, tmp_path: Path) -> None:
    draw_adaptation(
        tmp_path / "curves.svg",
        runs.of(Situation.PEOPLE_CLOSE).events,
        ["safety"],
        ["weight_of_pick", "weight_of_start"],
    )
    picture = (tmp_path / "curves.svg").read_text("utf-8")

    assert picture.startswith("<?xml")
    assert picture.count("<!-- start -->") >= 2  # at the choice, and in the legend
