"""The factorial design: its cells and arms, effects with known answers, and the report on short runs."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import pytest

from codra_dsl.integrations.inspection import read_spec
from codra_papers.experiments.campaign.document import Drawing, Table
from codra_papers.experiments.campaign.experiment import Experiment, Settings
from codra_papers.experiments.lab.algorithms import plain_preconditions, vision_algorithms
from codra_papers.experiments.lab.outcomes import ArmOutcome, Outcome
from codra_papers.experiments.lab.run import LabSettings, OneLoop, Work, run_lab
from codra_papers.experiments.lab.scoring import Piece
from codra_papers.experiments.lab.trials import run_trial
from codra_papers.experiments.studies import lab_robustness, lab_sensitivity
from codra_papers.experiments.studies.beyond.workloads import Tending
from codra_papers.experiments.studies.factors.design import (
    ARMS,
    CELLS,
    FACTORS,
    NAIVE_LIDS,
    PACED_ARMS,
    SEEDS_PER_CELL,
    Lid,
    Localiser,
    arm_name,
    factorial_trials,
    is_factorial,
    trial_arms,
)
from codra_papers.experiments.studies.factors.findings import effects
from codra_papers.experiments.studies.factors.report import FactorialReport, factorial_report
from codra_papers.lab.simulator.laboratory import Mount

SPEC = Path(__file__).parents[4] / "specs" / "lab.yaml"
LIDS = ("centrifuge_open", "pcr_cycler_open")


# Design


def test_every_combination_of_levels_is_one_cell() -> None:
    count = 1
    for levels in FACTORS.values():
        count *= len(levels)

    assert len({cell.levels for cell in CELLS}) == len(CELLS) == count
    assert CELLS[0].levels == tuple(next(iter(levels)) for levels in FACTORS.values())


@pytest.mark.parametrize("experiment", [lab_robustness.EXPERIMENT, lab_sensitivity.EXPERIMENT])
def test_by_default_every_cell_has_at_least_twelve_seeds_the_same_in_all_cells(
    experiment: Experiment, tmp_path: Path
) -> None:
    settings = Settings(spec=SPEC, seeds=experiment.seeds, folder=tmp_path)
    trials = [trial for trial in experiment.trials(settings) if is_factorial(trial.name)]

    for cell in CELLS:
        seeds = [trial.seed for trial in trials if trial.name.startswith(cell.trial_prefix)]
        assert len(seeds) == len(set(seeds)) >= SEEDS_PER_CELL
        assert seeds == sorted({trial.seed for trial in trials})
        assert {arm_name(arm, cell.localiser) for arm in ARMS} <= {arm.name for arm in trials[0].arms}


def test_the_arms_of_both_localisers_differ_only_in_the_function_that_they_call() -> None:
    spec = read_spec(SPEC)
    abstaining_arms, answering_arms = trial_arms()[: len(ARMS)], trial_arms()[len(ARMS) :]

    for abstaining_arm, answering_arm in zip(abstaining_arms, answering_arms, strict=True):
        *edits, last_edit = answering_arm.edits
        assert tuple(edits) == abstaining_arm.edits
        assert {
            (before.name, after.call)
            for before, after in zip(spec.perception, last_edit(spec).perception, strict=True)
            if before != after
        } == {
            (f"localize_{machine}_lid", "codra_papers.lab.perception.functions:localize_lid_always")
            for machine in ("centrifuge", "pcr_cycler")
        }


def test_the_arms_whose_triggers_are_compared_look_at_a_lid_at_the_same_cadence() -> None:
    for arm in (NAIVE_LIDS, *PACED_ARMS):
        spec = read_spec(SPEC)
        for edit in arm.edits:
            spec = edit(spec)
        lids = [algorithm for algorithm in spec.perception if algorithm.name.endswith("_lid")]
        assert {algorithm.min_interval_s for algorithm in lids} == {7.2}


def test_the_page_of_the_protocol_lists_the_factors_their_levels_and_the_arms() -> None:
    page = (SPEC.parents[1] / "docs" / "papers" / "protocol.md").read_text(encoding="utf-8")

    for factor, levels in FACTORS.items():
        assert f"| {factor} | {', '.join(levels)} |" in page
    for arm in ARMS:
        assert f"| {arm.name} |" in page


@pytest.mark.parametrize(
    "work",
    [
        OneLoop(leaves_lid_open=True),
        Tending(machines=("centrifuge", "pcr_cycler", "centrifuge"), leaves_lids_open=True),
    ],
)
def test_a_lid_that_is_left_open_is_closed_only_at_the_end_of_the_last_visit(work: Work) -> None:
    run = run_lab([], LabSettings(seed=7, work=work))

    assert [piece.value for piece in run.truth["centrifuge_open"]] == [False, True, False]
    assert run.truth["pcr_cycler_open"][-1].value is False
    assert run.error is None


# Effects


def outcome_with_ratios(name: str, seed: int, ratios: Mapping[str, float]) -> Outcome:
    """Return a run of 100 s in which each arm held a right value for this share of the time."""
    truth = {variable: (Piece(0.0, 100.0, True),) for variable in LIDS}
    arms = {
        arm: ArmOutcome(
            held={variable: (Piece(0.0, 100.0 * ratio, True), Piece(100.0 * ratio, 100.0, False)) for variable in LIDS},
            wrong=dict.fromkeys(LIDS, ()),
            first_s=dict.fromkeys(LIDS, 0.0),
            triggers={},
            observable_triggers={},
            slot_s=0.0,
            sources={},
        )
        for arm, ratio in ratios.items()
    }
    return Outcome(
        name=name,
        seed=seed,
        duration_s=100.0,
        loops=1,
        error=None,
        interruptions=[],
        frames=0,
        perceived=0,
        truth=truth,
        arms=arms,
        decisions=[],
        skills=[],
        kept=[],
    )


def test_effects_are_the_contrasts_of_the_design() -> None:
    """Levels add their own parts to the ratio of a seed, and an open lid and an answer take 0.2 more away together."""
    outcomes: dict[str, Outcome] = {}
    for seed, lid, camera in product((1, 2, 3), Lid, Mount):
        ratios = {
            arm_name(arm, localiser): 0.7
            + 0.01 * seed
            + 0.1 * (lid is Lid.OPEN)
            + 0.06 * (camera is Mount.PAN_TILT)
            - 0.04 * (localiser is Localiser.ANSWERS)
            - 0.2 * (lid is Lid.OPEN and localiser is Localiser.ANSWERS)
            for localiser in Localiser
            for arm in ARMS
        }
        name = f"lid {lid}, camera {camera} {seed}"
        outcomes[name] = outcome_with_ratios(name, seed, ratios)
    values = {effect.factors: effect.estimate.value for effect in effects(outcomes, "centrifuge_open", NAIVE_LIDS)}

    assert values == {
        ("localiser",): pytest.approx(-0.04 - 0.1),
        ("lid",): pytest.approx(0.1 - 0.1),
        ("camera",): pytest.approx(0.06),
        ("localiser", "lid"): pytest.approx(-0.1),
        ("localiser", "camera"): pytest.approx(0.0),
        ("lid", "camera"): pytest.approx(0.0),
        ("localiser", "lid", "camera"): pytest.approx(0.0),
    }


# Short runs


@dataclass(frozen=True)
class Reported:
    outcomes: Mapping[str, Outcome]
    report: FactorialReport


@pytest.fixture(scope="module")
def reported(tmp_path_factory: pytest.TempPathFactory) -> Reported:
    """Return one run of a minute for each level of lid and camera, and the report on them."""
    folder = tmp_path_factory.mktemp("factors")
    trials = factorial_trials(SPEC, [7], lambda lid: OneLoop(leaves_lid_open=lid is Lid.OPEN))
    outcomes = {trial.name: run_trial(replace(trial, duration_s=60.0), folder / trial.name) for trial in trials}
    return Reported(outcomes=outcomes, report=factorial_report(outcomes, vision_algorithms(read_spec(SPEC))))


def tables(report: FactorialReport) -> Sequence[Table]:
    return [part for part in report.section.parts if isinstance(part, Table)]


def test_the_report_has_a_row_for_every_cell_and_arm_beside_those_of_the_paper(reported: Reported) -> None:
    for table in tables(reported.report):
        assert {len(row) for row in table.rows} == {len(table.header)}
    ratio_tables = [table for table in tables(reported.report) if "balanced" in table.header]
    assert len(ratio_tables) == len(LIDS)
    for table in ratio_tables:
        assert [row[0] for row in table.rows[:2]] == ["P1", "P1"]
        assert len(table.rows) == 2 + len(CELLS) * len(ARMS)
    assert [row[4] for row in ratio_tables[0].rows[:2]] == ["0.921", "0.703"]
    assert json.loads(json.dumps(reported.report.results, allow_nan=False))


def test_the_summary_names_the_cell_nearest_to_the_paper_the_largest_effects_and_the_saved_triggers(
    reported: Reported,
) -> None:
    cells = [
        cell
        for cell in reported.report.results["cells"]
        if (cell["variable"], cell["arm"]) == ("centrifuge_open", NAIVE_LIDS.name) and cell["paper_ratio"] is not None
    ]
    nearest = min(cells, key=lambda cell: abs(cell["paper_ratio"] - 0.703))
    levels = f"localiser {nearest['localiser']}, lid {nearest['lid']}, camera {nearest['camera']}"
    nearest_sentence, effect_sentence, trigger_sentence = reported.report.summary

    assert f"Of these, {nearest['paper_ratio']:.3f} is nearest to P1's 0.703, with {levels}." in nearest_sentence
    assert "localiser (abstains to always answers)" in effect_sentence
    assert all(f"with {arm}" in effect_sentence for arm in (NAIVE_LIDS.name, "preconditions"))
    assert all(f"with {arm.name}" in trigger_sentence for arm in PACED_ARMS)


def test_the_picture_has_a_row_for_every_cell(reported: Reported) -> None:
    (picture,) = (part for part in reported.report.section.parts if isinstance(part, Drawing))

    assert all(f"<!-- {', '.join(cell.levels)} -->" in picture.svg for cell in CELLS)


def test_the_naive_arm_looks_only_at_lids_and_its_observable_looks_are_counted_by_truth(reported: Reported) -> None:
    algorithms = {"localize_centrifuge_lid", "localize_pcr_cycler_lid"}
    preconditions = plain_preconditions(read_spec(SPEC))
    for outcome in reported.outcomes.values():
        naive_arm = outcome.arms[arm_name(NAIVE_LIDS, Localiser.ABSTAINS)]
        assert set(naive_arm.triggers) == algorithms
        assert all(6 <= naive_arm.triggers[name] <= 9 for name in algorithms)  # once in 7.2 s of 60 s, or later
        for name in algorithms:
            assert 0 <= naive_arm.observable_triggers[name] <= naive_arm.triggers[name]
    assert preconditions["localize_centrifuge_lid"] == [
        "centrifuge_in_observable_distance",
        "centrifuge_base_in_FOV",
        "centrifuge_lid_in_FOV",
    ]
    assert "see_centrifuge_rotor" not in preconditions


def test_camera_jobs_and_distance_polls_are_all_jobs(reported: Reported) -> None:
    for finding in reported.report.results["cells"]:
        triggers = finding["triggers"]
        outcome = reported.outcomes[f"lid {finding['lid']}, camera {finding['camera']} 7"]
        arm = outcome.arms[f"{finding['arm']}; {finding['localiser']}"]
        assert triggers["lid"] + triggers["other_camera"] + triggers["distance_polls"] == sum(arm.triggers.values())
        is_naive = finding["arm"] == NAIVE_LIDS.name
        assert (triggers["distance_polls"] == 0) == is_naive


def test_both_cameras_watch_the_same_run(reported: Reported) -> None:
    for lid in Lid:
        wrist, mast = (reported.outcomes[f"lid {lid}, camera {camera} 7"] for camera in Mount)
        assert [(entry.instant_s, entry.answer) for entry in wrist.decisions] == [
            (entry.instant_s, entry.answer) for entry in mast.decisions
        ]
        assert wrist.skills == mast.skills
        assert wrist.truth["centrifuge_open"] == mast.truth["centrifuge_open"]
        assert wrist.truth["centrifuge_lid_in_FOV"] != mast.truth["centrifuge_lid_in_FOV"]
        assert wrist.frames == wrist.perceived
        assert mast.frames == mast.perceived


def test_a_report_without_runs_of_the_design_states_this() -> None:
    report = factorial_report({}, ())

    assert [getattr(part, "text", None) for part in report.section.parts] == ["No runs of the factorial design."]
    assert report.results == {"cells": [], "effects": []}
