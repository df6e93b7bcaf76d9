"""The experiment on saved time, on real runs: one opening and one closing, without observers and with them."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from xml.etree import ElementTree

import pytest

from codra_dsl.integrations.inspection import read_spec
from codra_papers.experiments.campaign.document import Document, Drawing, Photograph, Table
from codra_papers.experiments.campaign.experiment import FIRST_REPORTED_SEED, Settings
from codra_papers.experiments.campaign.trial_records import TrialRecord
from codra_papers.experiments.lab.algorithms import alternatives
from codra_papers.experiments.lab.arms import ALTERNATIVES
from codra_papers.experiments.lab.outcomes import OWN_LOOK, Outcome
from codra_papers.experiments.lab.trials import run_trial
from codra_papers.experiments.studies.lab_runtime import EXPERIMENT
from codra_papers.experiments.studies.lab_runtime.alternatives import answers
from codra_papers.experiments.studies.lab_runtime.executions import Execution, Task, executions, spent_s
from codra_papers.experiments.studies.lab_runtime.judgement import judge
from codra_papers.experiments.studies.lab_runtime.paper import PAPER
from codra_papers.experiments.studies.lab_runtime.runs import (
    DECISION_S,
    Pair,
    alternatives_trial,
    day_trials,
    tending_trials,
)
from codra_papers.experiments.studies.lab_runtime.wrong import mistakes
from codra_papers.experiments.studies.robustness.drawings import rings
from codra_papers.lab.mission import PCR_CYCLER, Mission, MissionError
from tests.papers.experiments.heads import unexplained_heads

SPECS = Path(__file__).parents[4] / "specs"
DAY_S = 300.0
UNTIL_THE_ROTOR_IS_TURNED_S = 335.0


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> Settings:
    return Settings(spec=SPECS / "lab.yaml", seeds=0, folder=tmp_path_factory.mktemp("lab-runtime"))


@pytest.fixture(scope="module")
def outcomes(settings: Settings) -> Mapping[str, Outcome]:
    """Return the outcomes of one opening and closing, and of the first minutes of a day."""
    short = [
        *tending_trials(settings, FIRST_REPORTED_SEED, times=1),
        *day_trials(settings, DAY_S),
        alternatives_trial(settings, UNTIL_THE_ROTOR_IS_TURNED_S),
    ]
    return {trial.name: run_trial(trial, settings.folder / "trials" / trial.name) for trial in short}


@pytest.fixture(scope="module")
def pair(outcomes: Mapping[str, Outcome]) -> Pair:
    run_without_observers, run_with_observers = (
        outcomes[f"tending-301-{condition}-observers"] for condition in ("without", "with")
    )
    return Pair(seed=FIRST_REPORTED_SEED, without=run_without_observers, observed=run_with_observers)


@pytest.fixture(scope="module")
def document(settings: Settings, outcomes: Mapping[str, Outcome]) -> Document:
    return judge(settings, outcomes)


def all_executions(pair: Pair) -> list[Execution]:
    return [*executions(pair.without), *executions(pair.observed)]


def test_an_opening_and_a_closing_are_measured_in_both_conditions(pair: Pair) -> None:
    assert [execution.task for execution in all_executions(pair)] == 2 * [Task.OPENING, Task.CLOSING]


def test_a_task_is_perception_other_decisions_and_acting(pair: Pair) -> None:
    for execution in all_executions(pair):
        parts_s = spent_s(execution.previews), spent_s(execution.monitors), spent_s(execution.other_decisions)
        assert execution.duration_s == pytest.approx(sum(parts_s) + execution.acting_s)
        assert execution.acting_s > 100.0


def test_the_same_seed_acts_alike_with_and_without_observers(pair: Pair) -> None:
    for task in Task:
        (without,), (observed,) = pair.executions_of(task)
        assert without.acting_s == pytest.approx(observed.acting_s)
        assert without.perception_s > observed.perception_s


def test_without_observers_the_robot_looks_for_every_decision_and_has_no_other_cost(pair: Pair) -> None:
    for decision in pair.without.decisions:
        assert decision.has_looked
        assert decision.looked_s == decision.answered_s - decision.instant_s
        assert (decision.waited_s, decision.unanswered) == (0.0, "")


def test_with_observers_every_decision_is_charged_with_its_cost(pair: Pair) -> None:
    assert len(pair.observed.decisions) > 10
    for decision in pair.observed.decisions:
        charged_s = decision.answered_s - decision.instant_s - decision.waited_s - decision.looked_s
        assert charged_s == pytest.approx(DECISION_S)


def test_a_repeated_run_gives_the_same_outcome(settings: Settings, pair: Pair, tmp_path: Path) -> None:
    _, observed = tending_trials(settings, FIRST_REPORTED_SEED, times=1)

    assert run_trial(observed, tmp_path) == pair.observed


def test_an_outcome_is_stored_completely(outcomes: Mapping[str, Outcome]) -> None:
    for outcome in outcomes.values():
        assert Outcome.from_json(outcome.to_json()) == outcome


def test_a_run_without_an_arm_has_the_truth_too(pair: Pair) -> None:
    assert pair.without.arms == {}
    assert {name: pieces[0] for name, pieces in pair.without.truth.items()}.keys() == pair.observed.truth.keys()
    assert all(decision.truth is not None for decision in pair.without.decisions)


def tables(document: Document) -> list[Table]:
    return [part for section in document.sections for part in section.parts if isinstance(part, Table)]


def test_every_row_of_the_report_has_a_cell_for_every_column(document: Document) -> None:
    assert len(tables(document)) >= 9
    for table in tables(document):
        assert {len(row) for row in table.rows} <= {len(table.header)}


def test_words_in_heads_that_need_an_explanation_have_one(document: Document) -> None:
    assert list(unexplained_heads(document)) == []
    assert {"preview", "reason"} < {row[0] for row in tables(document)[0].rows}


def test_the_report_shows_table_3_of_the_paper_beside_its_own(document: Document, pair: Pair) -> None:
    (table,) = (table for table in tables(document) if table.caption.startswith("Table 3"))
    (opening,), _ = pair.executions_of(Task.OPENING)

    assert [row[2] for row in table.rows] == [*PAPER[Task.OPENING].preview_s, *PAPER[Task.OPENING].monitoring_s]
    assert table.rows[0][3] == round(spent_s(opening.previews), 2)
    assert table.rows[2][3] == round(spent_s(opening.monitors), 2)


def test_the_drawing_is_svg_and_always_the_same(
    document: Document, settings: Settings, outcomes: Mapping[str, Outcome]
) -> None:
    drawings, repeated_drawings = (
        [part.svg for section in report.sections for part in section.parts if isinstance(part, Drawing)]
        for report in (document, judge(settings, outcomes))
    )

    assert drawings == repeated_drawings
    assert [ElementTree.fromstring(svg).tag for svg in drawings] == 3 * ["{http://www.w3.org/2000/svg}svg"]


def test_results_are_data_and_their_savings_add_up(document: Document) -> None:
    results = json.loads(json.dumps(document.results, allow_nan=False))
    saving = results["saving"]

    for name in ("opening", "closing", "all"):
        saving_of_task = saving[name]
        parts_s = saving_of_task["spared_s"] + saving_of_task["other_looks_s"] + saving_of_task["fewer_s"]
        assert saving_of_task["saved_s"] == pytest.approx(
            parts_s - saving_of_task["waiting_s"] - saving_of_task["asking_s"]
        )
    for first_name, second_name in (("opening", "closing"), ("previews", "monitoring")):
        assert saving["all"]["saved_s"] == pytest.approx(saving[first_name]["saved_s"] + saving[second_name]["saved_s"])


def test_the_summary_has_both_tasks_the_sources_the_day_and_wrong_values(document: Document) -> None:
    assert [next(word for word in WORDS if word in sentence) for sentence in document.summary] == list(WORDS)


WORDS = (
    "Opening the",
    "Closing the",
    "perception time is saved",
    "loops were completed",
    "Decisions of the day",
    "with alternatives;",
    "Lid out of view",
    "were not true",
)


def test_an_answer_from_the_evidence_of_an_alternative_is_counted(
    settings: Settings, outcomes: Mapping[str, Outcome]
) -> None:
    outcome = outcomes["day-with-alternatives"]
    seen_by_rotor = {decision.answered_s for decision in outcome.decisions if decision.source == "see_centrifuge_rotor"}

    ((variable, names),) = alternatives(read_spec(settings.spec)).items()
    counts = answers(outcome, variable, names)

    assert (variable, list(names)) == ("centrifuge_open", ["see_centrifuge_rotor"])
    assert counts.by_alternatives == len(seen_by_rotor) >= 1
    assert counts.by_alternatives < counts.answered <= counts.decisions
    assert counts.untrue == 0


def test_a_ring_of_the_arm_that_answers_is_known_if_and_only_if_the_robot_did_not_look(
    outcomes: Mapping[str, Outcome],
) -> None:
    outcome = outcomes["day-with-alternatives"]
    decisions = [decision for decision in outcome.decisions if decision.variable == "centrifuge_open"]
    arm_rings = rings(outcome, "centrifuge_open", ALTERNATIVES.name)

    assert any(decision.waited_s for decision in decisions)
    for decision, ring in zip(decisions, arm_rings, strict=True):
        assert (ring.verdict == "unknown") == decision.has_looked
        assert decision.instant_s <= ring.instant_s <= decision.answered_s
        if not decision.has_looked:
            assert ring.held == decision.answer


def test_every_decision_of_the_day_on_a_lid_is_counted_for_each_arm_that_watched(
    document: Document, outcomes: Mapping[str, Outcome]
) -> None:
    outcome = outcomes["day-with-observers"]
    decisions = [decision for decision in outcome.decisions if decision.variable == "centrifuge_open"]
    counts_by_arm = document.results["day_decisions"]["centrifuge_open"]

    assert list(counts_by_arm) == ["need, on event", "naive, lids", "need, on event, alternatives"]
    for counts in counts_by_arm.values():
        late_count = sum(count for column, count in counts.items() if column.endswith("late"))
        assert sum(counts.values()) - late_count == len(decisions) > 0


def test_the_day_is_cut_off_at_its_end(outcomes: Mapping[str, Outcome]) -> None:
    for condition in ("without", "with"):
        assert outcomes[f"day-{condition}-observers"].duration_s == DAY_S


def test_the_experiment_runs_seeds_and_a_day_in_pairs_and_the_day_with_alternatives(settings: Settings) -> None:
    trials = EXPERIMENT.trials(replace(settings, seeds=2))

    assert [trial.seed for trial in trials] == [301, 301, 302, 302, 303, 303, 301, 301, 301]
    assert len({trial.name for trial in trials}) == len(trials)


# Interruptions


@dataclass(frozen=True, slots=True)
class DriveAndFail:
    """Work that ends with an error."""

    def __call__(self, mission: Mission) -> None:
        mission.open_and_close(PCR_CYCLER, times=0)
        raise MissionError("nothing works")


def test_work_starts_again_after_a_repair(settings: Settings, tmp_path: Path) -> None:
    without, _ = day_trials(settings, 300.0)

    outcome = run_trial(replace(without, work=DriveAndFail(), repair_s=100.0), tmp_path)

    starts_s = [start_s for _, start_s, _ in outcome.skills]
    errors_s = [instant_s for instant_s, _ in outcome.interruptions]
    assert len(errors_s) >= 2
    assert starts_s[1 : len(errors_s)] == [instant_s + 100.0 for instant_s in errors_s[:-1]]
    assert {text for _, text in outcome.interruptions} == {"nothing works"}
    assert (outcome.error, outcome.duration_s) == (None, 300.0)


def test_without_a_repair_an_error_ends_the_run(settings: Settings, tmp_path: Path) -> None:
    without, _ = day_trials(settings, 300.0)

    outcome = run_trial(replace(without, work=DriveAndFail(), repair_s=None), tmp_path)

    assert (outcome.error, outcome.interruptions) == ("nothing works", [])
    assert outcome.duration_s < 100.0


# Decisions on wrong values


@pytest.fixture(scope="module")
def misled(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Outcome]:
    """Return a run whose observers mistake a locked latch for an unlocked one."""
    folder = tmp_path_factory.mktemp("misled")
    shutil.copytree(SPECS, folder / "specs")
    machine = folder / "specs" / "parts" / "machine.yaml"
    text = machine.read_text("utf-8")
    machine.write_text(text.replace("$(instance)_locked: latched", "$(instance)_locked: not latched"), "utf-8")
    settings = Settings(spec=folder / "specs" / "lab.yaml", seeds=0, folder=folder)
    _, observed = tending_trials(settings, FIRST_REPORTED_SEED, times=1)
    return folder, run_trial(replace(observed, duration_s=40.0), folder / "trials" / observed.name)


def test_a_decision_on_a_wrong_value_is_reported_with_its_frame_and_cause(misled: tuple[Path, Outcome]) -> None:
    folder, outcome = misled
    mistake = mistakes([outcome])[0]

    assert (mistake.decision.variable, mistake.decision.answer) == ("pcr_cycler_locked", False)
    assert mistake.basis.algorithm == "localize_pcr_cycler_lid"
    assert mistake.cause.startswith("seen wrongly: latched true")
    assert (folder / "trials" / outcome.name / mistake.basis.frame).read_bytes().startswith(b"\x89PNG")


def test_a_record_without_the_frame_of_a_wrong_answer_is_ignored(
    settings: Settings, misled: tuple[Path, Outcome], tmp_path: Path
) -> None:
    folder, outcome = misled
    wrongly_answered_decision = next(decision for decision in outcome.decisions if decision.wrong_answer is not None)
    outcome_without_frame = replace(outcome, decisions=[replace(wrongly_answered_decision, wrong={})])
    trial = replace(tending_trials(settings, FIRST_REPORTED_SEED)[0], name=outcome.name)
    record = TrialRecord(trial=trial, folder=tmp_path, digest="made-from")
    shutil.copytree(folder / "trials" / outcome.name, record.frames_folder)
    text = outcome_without_frame.to_json()
    record.path.write_text(f"made-from {sha256(text.encode()).hexdigest()}\n{text}")
    record_before = record.read()
    assert wrongly_answered_decision.wrong_answer is not None
    (record.frames_folder / wrongly_answered_decision.wrong_answer.frame).unlink()

    assert record_before == outcome_without_frame
    assert record.read() is None


def test_an_answer_is_judged_by_the_truth_at_the_answer_and_not_at_the_request(
    misled: tuple[Path, Outcome],
) -> None:
    _, outcome = misled
    wrong_decisions = mistakes([outcome])

    for decision in outcome.decisions:
        is_true = decision.answer == truth_at(outcome, decision.variable)(decision.answered_s)
        assert is_true == (decision.wrong_answer is None)
    assert len(wrong_decisions) == sum(decision.wrong_answer is not None for decision in outcome.decisions) > 0


def truth_at(outcome: Outcome, variable: str) -> Callable[[float], object]:
    def value(instant_s: float) -> object:
        return next(piece.value for piece in outcome.truth[variable] if piece.start_s <= instant_s < piece.end_s)

    return value


def test_the_report_lists_mistakes_with_their_frames(
    settings: Settings, outcomes: Mapping[str, Outcome], misled: tuple[Path, Outcome]
) -> None:
    folder, outcome = misled
    document = judge(replace(settings, folder=folder), {**outcomes, outcome.name: outcome})
    photographs = [part for section in document.sections for part in section.parts if isinstance(part, Photograph)]

    assert len(document.results["wrong_decisions"]) >= 1
    assert photographs
    assert all(photograph.path.is_file() for photograph in photographs)


def test_a_wrong_look_of_the_robot_itself_has_a_cause_of_its_own(misled: tuple[Path, Outcome]) -> None:
    _, outcome = misled
    first_mistake = mistakes([outcome])[0]
    looked_decision = replace(first_mistake.decision, wrong_answer=replace(first_mistake.basis, algorithm=OWN_LOOK))

    assert mistakes([replace(outcome, decisions=[looked_decision])])[0].cause == "the robot's own look was wrong"
