"""The report on short runs of all arms, which use real frames: recounted numbers are equal."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import pytest

from codra_dsl.integrations.inspection import read_spec
from codra_papers.experiments.campaign.campaign import TRIALS
from codra_papers.experiments.campaign.document import Document, Drawing, Photograph, Table
from codra_papers.experiments.campaign.experiment import Settings
from codra_papers.experiments.lab.outcomes import Basis, Outcome
from codra_papers.experiments.lab.trials import Trial, run_trial, value_at
from codra_papers.experiments.studies.factors.design import is_factorial
from codra_papers.experiments.studies.lab_robustness import ARMS, EXPERIMENT, FURTHER_ARMS
from codra_papers.experiments.studies.robustness.findings import VARIABLES, Runs
from codra_papers.experiments.studies.robustness.frames import detect_again
from codra_papers.experiments.studies.robustness.mistakes import mistakes, mistakes_table, photographs
from tests.papers.experiments.heads import unexplained_heads

SPEC = Path(__file__).parents[4] / "specs" / "lab.yaml"
DURATION_S, DURATION_OF_FURTHER_RUNS_S = 60.0, 10.0
FRAMES_KEPT = 20
TABLE_SEEDS, FURTHER_MACHINES = (301, 302), (311, 312)


@dataclass(frozen=True)
class Judged:
    settings: Settings
    outcomes: Mapping[str, Outcome]
    document: Document


@pytest.fixture(scope="module")
def judged_runs(tmp_path_factory: pytest.TempPathFactory) -> Judged:
    """Return four short runs, two of them in the tables, and the report on them."""
    settings = Settings(spec=SPEC, seeds=2, folder=tmp_path_factory.mktemp("robustness"))
    durations_s = dict.fromkeys(TABLE_SEEDS, DURATION_S) | dict.fromkeys(FURTHER_MACHINES, DURATION_OF_FURTHER_RUNS_S)
    outcomes = {
        trial.name: run_trial(short_trial(trial, durations_s[trial.seed]), settings.folder / TRIALS / trial.name)
        for trial in EXPERIMENT.trials(settings)
        if trial.seed in durations_s
    }
    return Judged(settings=settings, outcomes=outcomes, document=EXPERIMENT.judge(settings, outcomes))


def short_trial(trial: Trial, duration_s: float) -> Trial:
    return replace(trial, duration_s=duration_s, frames_kept=min(trial.frames_kept, FRAMES_KEPT))


def tables(document: Document) -> list[Table]:
    return [part for section in document.sections for part in section.parts if isinstance(part, Table)]


def test_ten_runs_are_for_the_tables_and_keep_frames_and_the_further_ones_are_for_intervals() -> None:
    trials = [
        trial
        for trial in EXPERIMENT.trials(Settings(spec=SPEC, seeds=20, folder=Path()))
        if not is_factorial(trial.name)
    ]

    assert [trial.seed for trial in trials] == list(range(301, 331))
    assert sum(trial.frames_kept for trial in trials if trial.seed <= 310) >= 200
    assert {trial.answering_arm for trial in trials} == {None}
    assert {trial.arms for trial in trials if trial.seed <= 310} == {ARMS}
    assert {trial.arms for trial in trials if trial.seed > 310} == {FURTHER_ARMS}
    assert len({trial.name for trial in trials}) == 30


def test_every_row_of_every_table_has_a_cell_for_every_column_and_marks_lie_in_it(judged_runs: Judged) -> None:
    all_tables = tables(judged_runs.document)

    assert len(all_tables) >= 14
    for table in all_tables:
        assert {len(row) for row in table.rows} <= {len(table.header)}
        assert all(row < len(table.rows) and column < len(table.header) for row, column in table.marked)


def test_words_in_heads_that_need_an_explanation_have_one(judged_runs: Judged) -> None:
    assert list(unexplained_heads(judged_runs.document)) == []
    assert {"late", "lag", "p90", "slot"} < {row[0] for row in tables(judged_runs.document)[0].rows}


def test_the_same_outcomes_give_the_same_report(judged_runs: Judged) -> None:
    repeated_document = EXPERIMENT.judge(judged_runs.settings, judged_runs.outcomes)

    assert repeated_document == judged_runs.document


def test_results_are_plain_data_with_every_variable_and_arm(judged_runs: Judged) -> None:
    results = json.loads(json.dumps(judged_runs.document.results, allow_nan=False))

    for part, expected in (("tables", ARMS), ("further", FURTHER_ARMS)):
        variables = results[part]["variables"]
        assert len(variables) == 14
        assert all(set(arms) == {arm.name for arm in expected} for arms in variables.values())


def test_seconds_of_complete_runs_add_up_to_the_runs(judged_runs: Judged) -> None:
    for arms in judged_runs.document.results["tables"]["variables"].values():
        for variable_results in arms.values():
            assert sum(variable_results["whole_runs"].values()) == pytest.approx(DURATION_S * len(TABLE_SEEDS))


def test_the_seconds_of_table_2_equal_those_of_sampling(judged_runs: Judged) -> None:
    step_s = 0.01
    for index, seed in enumerate(TABLE_SEEDS):
        outcome = judged_runs.outcomes[f"run-{seed}"]
        first_s = {arm: arm_outcome.first_s["centrifuge_open"] for arm, arm_outcome in outcome.arms.items()}
        start_s = max(instant_s for instant_s in first_s.values() if instant_s is not None)
        instants = [start_s + step_s * (number + 0.5) for number in range(int((DURATION_S - start_s) / step_s))]
        for arm, arm_outcome in outcome.arms.items():
            window = judged_runs.document.results["tables"]["variables"]["centrifuge_open"][arm]["window_by_run"][index]
            if first_s[arm] is None:
                assert window is None
                continue
            held_values = [value_at(arm_outcome.held["centrifuge_open"], instant_s) for instant_s in instants]
            true_values = [value_at(outcome.truth["centrifuge_open"], instant_s) for instant_s in instants]
            right_count = sum(
                value == true_value
                for value, true_value in zip(held_values, true_values, strict=True)
                if value is not None
            )
            assert window["right_s"] == pytest.approx(right_count * step_s, abs=0.2)
            assert window["unknown_s"] == pytest.approx(held_values.count(None) * step_s, abs=0.2)


def test_wrong_seconds_by_cause_add_up_to_the_wrong_seconds(judged_runs: Judged) -> None:
    for arms in judged_runs.document.results["tables"]["variables"].values():
        for variable_results in arms.values():
            assert sum(variable_results["wrong_by_cause"].values()) == pytest.approx(
                variable_results["whole_runs"]["wrong_s"], abs=1e-6
            )


def test_wrong_seconds_in_the_windows_are_divided_into_mistakes_and_lag(judged_runs: Judged) -> None:
    for arms in judged_runs.document.results["tables"]["variables"].values():
        for variable_results in arms.values():
            assert sum(variable_results["window_wrong_by_cause"].values()) == pytest.approx(
                variable_results["window_total"]["wrong_s"], abs=1e-6
            )


def test_every_ratio_has_a_balanced_ratio_and_a_constant_answer_beside_it(judged_runs: Judged) -> None:
    ratio_keys = {"paper_ratio", "balanced_ratio", "strict_ratio", "strict_balanced_ratio", "constant_answer_ratio"}
    results_of_arms = judged_runs.document.results["tables"]["variables"]["centrifuge_base_in_FOV"].values()

    assert all(ratio_keys <= set(variable_results) for variable_results in results_of_arms)
    (constant_ratio,) = {variable_results["constant_answer_ratio"] for variable_results in results_of_arms}
    assert 0.5 <= constant_ratio <= 1.0


def test_an_arm_that_never_identified_a_variable_is_left_out_of_the_window_and_marked(judged_runs: Judged) -> None:
    runs = Runs([judged_runs.outcomes[f"run-{seed}"] for seed in TABLE_SEEDS])
    table = next(
        table for table in tables(judged_runs.document) if table.caption.startswith("Seconds over complete runs")
    )
    marked = {table.rows[row][:2] for row, _ in table.marked}
    left_out = {
        (name.replace("pcr_cycler", "PCR-cycler"), arm)
        for name in VARIABLES
        for arm in runs.arms
        if runs.left_out(name, arm)
    }

    assert marked == left_out
    assert ("PCR-cycler_open", "preconditions") in marked  # the robot has not yet driven there


def test_kept_frames_detected_again_from_their_files_give_exactly_the_recorded_evidence(judged_runs: Judged) -> None:
    comparison_of_frames = judged_runs.document.results["frames_detected_again"]

    assert comparison_of_frames == {"frames": 2 * FRAMES_KEPT, "agreed": 2 * FRAMES_KEPT, "different": []}


def test_a_frame_that_was_changed_or_lost_is_reported(judged_runs: Judged, tmp_path: Path) -> None:
    outcome = judged_runs.outcomes["run-301"]
    with_tags = next(stored_frame for stored_frame in outcome.kept if stored_frame.values.get("markers", 0) > 0)
    missing_frame = next(stored_frame for stored_frame in outcome.kept if stored_frame.file != with_tags.file)
    source, copy = judged_runs.settings.folder / TRIALS / "run-301", tmp_path / TRIALS / "run-301"
    copy.mkdir(parents=True)
    pixels = cv2.imread(str(source / with_tags.file))
    assert cv2.imwrite(str(copy / with_tags.file), pixels[:, ::-1])  # no tag looks the same in a mirror

    detected_frames = detect_again(read_spec(SPEC), [replace(outcome, kept=[with_tags, missing_frame])], tmp_path)

    assert [detected_frame.agrees for detected_frame in detected_frames] == [False, False]
    assert detected_frames[0].values is not None
    assert detected_frames[1].values is None


def test_every_wrong_value_at_a_decision_is_listed_with_its_evidence_and_frame(judged_runs: Judged) -> None:
    runs = Runs([with_a_wrong_value(judged_runs.outcomes["run-301"]), judged_runs.outcomes["run-302"]])
    wrong_entries = [
        (outcome.seed, round(decision.instant_s, 1), arm)
        for outcome in runs.outcomes
        for decision in outcome.decisions
        if decision.variable in VARIABLES
        for arm, held_value in decision.held.items()
        if held_value is not None and held_value != decision.truth
    ]
    wrong_values = mistakes(runs)
    shown_photographs = photographs(wrong_values, judged_runs.settings.folder)

    assert [(row[0], row[1], row[5]) for row in mistakes_table(wrong_values).rows] == wrong_entries
    assert all((judged_runs.settings.folder / mistake.frame).is_file() for mistake in wrong_values if mistake.frame)
    assert (
        len(shown_photographs) == len({(mistake.arm, mistake.cause) for mistake in wrong_values if mistake.frame}) >= 1
    )
    assert "seen wrongly" in shown_photographs[0].caption


def with_a_wrong_value(outcome: Outcome) -> Outcome:
    """Return the run as if the last decision's truth had been the opposite, with a stored frame as evidence."""
    *other_decisions, last_decision = outcome.decisions
    stored_frame = outcome.kept[0]
    basis = Basis(
        algorithm=stored_frame.algorithm,
        evidence_s=stored_frame.evidence_s,
        values=stored_frame.values,
        was_true=False,
        frame=stored_frame.file,
    )
    wrong_entries = {arm: basis for arm, held_value in last_decision.held.items() if held_value is not None}
    assert wrong_entries
    return replace(
        outcome,
        decisions=[*other_decisions, replace(last_decision, truth=not last_decision.truth, wrong=wrong_entries)],
    )


def test_the_summary_answers_the_questions_of_the_protocol(judged_runs: Judged) -> None:
    summary = " ".join(judged_runs.document.summary)

    for expected_text in (
        "Hoped for: at least 0.985",
        "Hoped for: 90 %",
        "P1: 79.4 %",
        "further runs",
        "detected again",
    ):
        assert expected_text in summary


def test_an_arm_with_twice_the_triggers_triggers_more_often_and_not_less_often_by_a_negative_share(
    judged_runs: Judged,
) -> None:
    outcomes = {
        name: with_triggers(outcome, {"naive": 10, "preconditions": 20})
        for name, outcome in judged_runs.outcomes.items()
    }
    summary = EXPERIMENT.judge(judged_runs.settings, outcomes).summary
    sentence = next(text for text in summary if text.startswith("preconditions triggers the PCR-cycler's lid"))

    assert "100.0 [100.0, 100.0] % more often than naive (P1: 79.4 % less often)" in sentence


def with_triggers(outcome: Outcome, count_by_arm: Mapping[str, int]) -> Outcome:
    algorithms = {algorithm for arm in outcome.arms.values() for algorithm in arm.triggers}
    arms = {
        name: replace(arm, triggers=dict.fromkeys(algorithms, count_by_arm.get(name, 1)))
        for name, arm in outcome.arms.items()
    }
    return replace(outcome, arms=arms)


def test_drawings_are_complete_svg_documents_and_photographs_are_files(judged_runs: Judged) -> None:
    parts = [part for section in judged_runs.document.sections for part in section.parts]
    drawings_in_report = [part for part in parts if isinstance(part, Drawing)]

    assert len(drawings_in_report) == 4
    assert all(part.svg.rstrip().endswith("</svg>") for part in drawings_in_report)
    assert all(part.path.is_file() for part in parts if isinstance(part, Photograph))


def test_without_further_seeds_the_report_has_no_intervals(judged_runs: Judged) -> None:
    outcomes_of_tables = {
        name: outcome for name, outcome in judged_runs.outcomes.items() if outcome.seed in TABLE_SEEDS
    }
    document = EXPERIMENT.judge(replace(judged_runs.settings, seeds=0), outcomes_of_tables)
    section = next(section for section in document.sections if section.title == "How sure differences are")

    assert [getattr(part, "text", None) for part in section.parts] == ["No further seeds were run."]
