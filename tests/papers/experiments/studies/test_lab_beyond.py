"""Reports of the experiments beyond the paper on short runs, which use real frames: recounted numbers are equal."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest

from codra_dsl.integrations.inspection import SpecError, read_spec
from codra_dsl.language.check import check
from codra_dsl.language.model import Condition
from codra_papers.experiments.campaign.document import Document, Drawing, Table
from codra_papers.experiments.campaign.experiment import FIRST_REPORTED_SEED, Experiment, Settings
from codra_papers.experiments.campaign.registry import experiments
from codra_papers.experiments.lab.arms import NAIVE, PRECONDITIONS
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.lab.scoring import Piece
from codra_papers.experiments.lab.spec_variants import WithoutAlternatives, WithoutCondition
from codra_papers.experiments.lab.trials import Trial, run_trial
from codra_papers.experiments.studies import lab_ablation, lab_budgets, lab_options, lab_sensitivity, lab_transfer
from codra_papers.experiments.studies.beyond.arm_comparison import LIDS_AND_LATCHES, arm_comparisons, pooled_seconds
from codra_papers.experiments.studies.beyond.more_machines import FURTHER_MACHINES, spec_with
from codra_papers.experiments.studies.beyond.parameters import ScaledNumber
from codra_papers.experiments.studies.beyond.workloads import Tending, Waiting
from codra_papers.experiments.studies.factors.design import is_factorial
from codra_papers.experiments.studies.lab_disturbances import EXPERIMENT as DISTURBANCES
from codra_papers.experiments.studies.lab_disturbances import (
    Belief,
    Episode,
    belief_in,
    episodes,
    right_again_s,
)
from codra_papers.experiments.studies.robustness.findings import Runs
from codra_papers.lab.simulator.laboratory import LABORATORY, LidMoved, PersonBefore

SPEC = Path(__file__).parents[4] / "specs" / "lab.yaml"
LID = "pcr_cycler_open"
DURATION_S = 40.0
EXPERIMENTS = [
    DISTURBANCES,
    lab_options.EXPERIMENT,
    lab_ablation.EXPERIMENT,
    lab_transfer.EXPERIMENT,
    lab_budgets.EXPERIMENT,
    lab_sensitivity.EXPERIMENT,
]


def settings(folder: Path, seeds: int = 2) -> Settings:
    return Settings(spec=SPEC, seeds=seeds, folder=folder)


@dataclass(frozen=True)
class Judged:
    outcomes: Mapping[str, Outcome]
    document: Document


def run_and_judge(experiment: Experiment, folder: Path, seeds: int = 2, duration_s: float = DURATION_S) -> Judged:
    """Return short runs of an experiment, and the report on them."""
    run_settings = settings(folder, seeds)
    outcomes = {
        trial.name: run_trial(replace(trial, duration_s=duration_s), folder / trial.name)
        for trial in experiment.trials(run_settings)
        if not is_factorial(trial.name)
    }
    return Judged(outcomes=outcomes, document=experiment.judge(run_settings, outcomes))


@pytest.fixture(scope="module")
def options(tmp_path_factory: pytest.TempPathFactory) -> Judged:
    return run_and_judge(lab_options.EXPERIMENT, tmp_path_factory.mktemp("options"), duration_s=8.0)


@pytest.fixture(scope="module")
def ablation(tmp_path_factory: pytest.TempPathFactory) -> Judged:
    return run_and_judge(lab_ablation.EXPERIMENT, tmp_path_factory.mktemp("ablation"), seeds=1)


def tables(document: Document) -> list[Table]:
    return [part for section in document.sections for part in section.parts if isinstance(part, Table)]


def test_they_are_registered_by_name() -> None:
    assert set(experiments()) >= {experiment.name for experiment in EXPERIMENTS}


@pytest.mark.parametrize("experiment", EXPERIMENTS)
def test_reports_use_seeds_that_were_not_used_for_tuning(experiment: Experiment, tmp_path: Path) -> None:
    trials = experiment.trials(settings(tmp_path, experiment.seeds))

    assert min(trial.seed for trial in trials) >= FIRST_REPORTED_SEED
    assert len({trial.name for trial in trials}) == len(trials)
    assert {trial.answering_arm for trial in trials} == {None}


def test_every_row_of_every_table_has_a_cell_for_every_column(options: Judged, ablation: Judged) -> None:
    for table in (*tables(options.document), *tables(ablation.document)):
        assert {len(row) for row in table.rows} <= {len(table.header)}
        assert all(row < len(table.rows) and column < len(table.header) for row, column in table.marked)


def test_the_same_outcomes_give_the_same_report_and_results_are_plain_data(options: Judged, tmp_path: Path) -> None:
    repeated_document = lab_options.EXPERIMENT.judge(settings(tmp_path), options.outcomes)

    assert repeated_document == options.document
    assert json.loads(json.dumps(repeated_document.results, allow_nan=False))


def test_an_option_that_would_not_change_the_spec_has_no_arm(tmp_path: Path) -> None:
    spec = read_spec(SPEC)

    for arm in lab_options.arms(settings(tmp_path))[1:-1]:
        assert arm.edits[-1](spec) != spec


def test_every_condition_of_the_spec_without_alternatives_is_removed_once(tmp_path: Path) -> None:
    spec = WithoutAlternatives()(read_spec(SPEC))
    edits = [arm.edits[-1] for arm in lab_ablation.arms(settings(tmp_path))[1:-1]]
    lost = 0
    for edit in edits:
        assert isinstance(edit, WithoutCondition)
        lost += sum(
            len(before.observable_when) + len(before.accept_when) - len(after.observable_when) - len(after.accept_when)
            for before, after in zip(spec.perception, edit(spec).perception, strict=True)
        )

    assert lost == sum(len(algorithm.observable_when) + len(algorithm.accept_when) for algorithm in spec.perception)
    assert len(set(edits)) == len(edits) > 5


def test_an_arm_differs_in_one_edit_from_the_arm_that_it_is_compared_with(tmp_path: Path) -> None:
    without_one = lab_ablation.arms(settings(tmp_path))[1:-1]
    with_another_number = lab_sensitivity.arms(settings(tmp_path))[2:]

    for arm in (*without_one, *with_another_number):
        assert arm == PRECONDITIONS.with_edit(arm.name, arm.edits[-1])
    for arm in lab_options.arms(settings(tmp_path))[1:-1]:
        assert arm == lab_options.UNCHANGED_ARM.with_edit(arm.name, arm.edits[-1])


def test_an_arm_comparison_equals_a_recount(ablation: Judged) -> None:
    outcomes = list(ablation.outcomes.values())
    first = arm_comparisons(outcomes, LIDS_AND_LATCHES, PRECONDITIONS.name, ("localize_centrifuge_lid",))[0]
    runs = Runs(outcomes)

    assert first.arm == PRECONDITIONS.name
    assert first.paper_difference is None
    right_s = sum(runs.total(name, first.arm).right_s for name in LIDS_AND_LATCHES)
    assert first.seconds.right_s == pytest.approx(right_s)
    assert first.seconds.right_s == pytest.approx(
        sum(pooled_seconds(outcome, LIDS_AND_LATCHES, first.arm).right_s for outcome in outcomes)
    )
    assert first.triggers == sum(outcome.arms[first.arm].triggers["localize_centrifuge_lid"] for outcome in outcomes)


def test_differences_use_the_variables_that_both_arms_identified(ablation: Judged) -> None:
    outcomes = list(ablation.outcomes.values())
    comparisons_by_arm = {
        comparison.arm: comparison for comparison in arm_comparisons(outcomes, LIDS_AND_LATCHES, PRECONDITIONS.name, ())
    }
    centrifuge = ("centrifuge_open", "centrifuge_locked")
    centrifuge_comparisons = {
        comparison.arm: comparison for comparison in arm_comparisons(outcomes, centrifuge, PRECONDITIONS.name, ())
    }

    assert comparisons_by_arm[PRECONDITIONS.name].left_out >= 2  # the robot has not yet driven to the PCR-cycler
    assert comparisons_by_arm[NAIVE.name].left_out < comparisons_by_arm[PRECONDITIONS.name].left_out
    assert comparisons_by_arm[NAIVE.name].paper_difference == centrifuge_comparisons[NAIVE.name].paper_difference


def test_without_its_precondition_an_algorithm_also_looks_from_afar(ablation: Judged) -> None:
    arm = "*_in_view without *_in_observable_distance"
    outcome = next(iter(ablation.outcomes.values()))
    triggers_everywhere, triggers_nearby = (outcome.arms[name].triggers for name in (arm, PRECONDITIONS.name))

    assert triggers_everywhere["find_pcr_cycler_in_view"] > triggers_nearby.get("find_pcr_cycler_in_view", 0)


# Disturbances


TRUTH = (Piece(0.0, 10.0, True), Piece(10.0, 30.0, False))


@pytest.mark.parametrize(
    ("held_pieces", "expected"),
    [
        ((Piece(0.0, 30.0, False),), 0.0),  # from 10 s on the value is right, as it was before
        ((Piece(0.0, 14.0, True), Piece(14.0, 30.0, False)), 4.0),
        ((Piece(0.0, 12.0, True), Piece(12.0, 13.0, False), Piece(13.0, 17.0, None), Piece(17.0, 30.0, False)), 7.0),
        ((Piece(0.0, 30.0, True),), None),
        ((Piece(0.0, 25.0, False), Piece(25.0, 30.0, True)), 0.0),  # a value after the end does not count
    ],
)
def test_right_again_is_when_it_stays_right_to_the_end(held_pieces: tuple[Piece, ...], expected: float | None) -> None:
    assert right_again_s(held_pieces, TRUTH, 10.0, 20.0) == expected


def test_episodes_follow_one_another_and_hold_their_disturbances() -> None:
    for before, after in pairwise(episodes("centrifuge")):
        assert before.start_s < before.disturbance_end_s < before.until_s == after.start_s
    for episode in episodes("centrifuge"):
        assert all(
            episode.start_s <= disturbance.at_s < episode.disturbance_end_s for disturbance in episode.disturbances
        )


@pytest.fixture(scope="module")
def disturbed_run(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    """Return a run beside the PCR-cycler: somebody opens its lid, and closes the lid while a person hides it."""
    disturbances = (
        LidMoved(at_s=27.0, machine="pcr_cycler", open_share=1.0),
        PersonBefore(at_s=46.0, lasts_s=14.0),
        LidMoved(at_s=50.0, machine="pcr_cycler", open_share=0.0),
    )
    trial = Trial(
        name="disturbed",
        spec=SPEC,
        seed=1,
        arms=(NAIVE, PRECONDITIONS),
        laboratory=replace(LABORATORY, disturbances=disturbances),
        work=Tending(machines=("pcr_cycler",)),
        duration_s=76.0,
    )
    return run_trial(trial, tmp_path_factory.mktemp("disturbed"))


def belief(outcome: Outcome, arm: str, *times_s: float) -> Belief:
    start_s, disturbance_end_s, until_s = times_s
    episode = Episode(name="", start_s=start_s, disturbance_end_s=disturbance_end_s, until_s=until_s, disturbances=())
    return belief_in([outcome], episode, LID, arm)


def test_a_lid_that_somebody_opened_is_true_and_is_seen_by_both_arms(disturbed_run: Outcome) -> None:
    assert [piece.value for piece in disturbed_run.truth[LID]] == [False, True, False]
    for arm in (NAIVE.name, PRECONDITIONS.name):
        lid_belief = belief(disturbed_run, arm, 27.0, 30.0, 46.0)
        (again_s,) = lid_belief.right_again_s
        assert again_s is not None
        assert 0.0 < again_s < 16.0
        assert (
            lid_belief.seconds_during.strict_share.total + lid_belief.seconds_after.strict_share.total
            == pytest.approx(19.0)
        )


def test_a_change_behind_a_person_is_believed_wrongly_until_the_person_has_gone(disturbed_run: Outcome) -> None:
    for arm in (NAIVE.name, PRECONDITIONS.name):
        lid_belief = belief(disturbed_run, arm, 46.0, 62.0, 76.0)
        assert lid_belief.seconds_during.wrong_s > 8.0
        assert lid_belief.right_again_s[0] is None or lid_belief.right_again_s[0] > 14.0


def test_waiting_ends_at_its_instant_and_closes_the_machine() -> None:
    assert DISTURBANCES.trials(settings(Path(), 1))[0].work == Waiting(machine="pcr_cycler", until_s=1380.0)


# More machines, and other laboratories


def test_a_third_machine_needs_one_more_line_and_is_known_and_seen(tmp_path: Path) -> None:
    transfer = run_and_judge(lab_transfer.EXPERIMENT, tmp_path, seeds=1, duration_s=70.0)
    before, after = SPEC.read_text().splitlines(), (tmp_path / "spec" / "lab.yaml").read_text().splitlines()
    (outcome,) = transfer.outcomes.values()

    assert [line for line in after if line not in before] == [f"  {transfer.document.results['line']}"]
    assert [line for line in after if line in before] == before
    assert outcome.arms[NAIVE.name].first_s["shaker_open"] is not None
    assert outcome.arms[PRECONDITIONS.name].first_s["shaker_open"] is not None
    assert "Lid and latch of the shaker" in transfer.document.summary[0]


def test_a_spec_without_a_block_of_use_is_refused(tmp_path: Path) -> None:
    (tmp_path / "bare.yaml").write_text(
        "codra: 1\nname: bare\ncontext:\n  near: {type: bool, source: main_execution}\n"
    )

    with pytest.raises(SpecError, match="under 'use'"):
        spec_with(tmp_path / "bare.yaml", FURTHER_MACHINES, tmp_path / "made")


def test_more_machines_leave_naive_observers_fewer_looks(tmp_path: Path) -> None:
    budgets = run_and_judge(lab_budgets.EXPERIMENT, tmp_path, seeds=1, duration_s=40.0)
    jobs = {
        count: budgets.outcomes[f"machines-{count}-run-{FIRST_REPORTED_SEED}"].arms[NAIVE.name].triggers
        for count in lab_budgets.MACHINE_COUNTS
    }

    assert jobs[2]["localize_centrifuge_lid"] > jobs[4]["localize_centrifuge_lid"] > jobs[8]["localize_centrifuge_lid"]
    assert {name for name in jobs[8] if name.startswith("localize_") and name.endswith("_lid")} == {
        f"localize_{machine}_lid"
        for machine in ("centrifuge", "pcr_cycler", *(machine.name for machine in FURTHER_MACHINES))
    }
    assert {len(row) for table in tables(budgets.document) for row in table.rows} == {3, 9, 12}


def test_further_machines_are_in_free_places_with_tags_of_their_own() -> None:
    machines = LABORATORY.with_machines(*FURTHER_MACHINES).machines
    ids = [tag.tag_id for machine in machines for tag in machine.tags]

    assert len(set(ids)) == len(ids)
    for first, second in combinations(machines, 2):
        assert np.linalg.norm(first.map_from_base.translation_m - second.map_from_base.translation_m) > 1.0


def test_every_number_of_the_spec_is_made_smaller_and_larger_and_still_compiles(tmp_path: Path) -> None:
    spec = read_spec(SPEC)
    changed_arms = lab_sensitivity.arms(settings(tmp_path))[2:]

    assert len(changed_arms) > 10
    for arm in changed_arms:
        edit = arm.edits[-1]
        checked_spec, _ = check(edit(spec))
        assert checked_spec is not None
        assert edit(spec) != spec


def test_a_number_is_scaled_in_its_condition_and_a_count_stays_an_integer() -> None:
    spec = read_spec(SPEC)
    nearer_spec = ScaledNumber(condition="distance < 1.6 m", variables="_in_observable_distance", factor=0.5)(spec)
    stricter_spec = ScaledNumber(condition="markers >= 3", variables="", factor=1.5)(spec)
    texts = {
        entry.by.text
        for algorithm in nearer_spec.perception
        for entry in algorithm.identifies
        if isinstance(entry.by, Condition)
    }

    assert {"distance < 0.8 m", "distance < 0.95 m"} <= texts
    assert "distance < 1.6 m" not in texts
    assert "markers >= 5" in {
        condition.text for algorithm in stricter_spec.perception for condition in algorithm.accept_when
    }


def test_every_laboratory_is_compared_with_naive_observers_in_it(tmp_path: Path) -> None:
    sensitivity = run_and_judge(lab_sensitivity.EXPERIMENT, tmp_path, seeds=1, duration_s=4.0)
    names = {"as it is", *(variation.name for variation in lab_sensitivity.VARIATIONS)}

    assert set(sensitivity.document.results) == {*names, "factors"}
    assert all({NAIVE.name, PRECONDITIONS.name} <= set(sensitivity.document.results[name]) for name in names)
    drawings = [
        part for section in sensitivity.document.sections for part in section.parts if isinstance(part, Drawing)
    ]
    assert len(drawings) == 2
    assert all(part.svg.rstrip().endswith("</svg>") for part in drawings)
    assert sensitivity.outcomes[f"tag size 0.5 {FIRST_REPORTED_SEED}"].truth != {}
