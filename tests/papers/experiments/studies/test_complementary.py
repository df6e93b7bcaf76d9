"""Complementary observers, on a short run with real frames: recounted numbers are equal."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from codra_dsl.integrations.inspection import read_spec
from codra_papers.experiments.campaign.document import Drawing, Table
from codra_papers.experiments.campaign.experiment import Settings
from codra_papers.experiments.lab.algorithms import alternatives
from codra_papers.experiments.lab.arms import (
    ALTERNATIVES,
    NEED_ON_EVENT,
    PRECONDITIONS,
    PRECONDITIONS_ALTERNATIVES,
    WITHOUT_ALTERNATIVES,
    Arm,
)
from codra_papers.experiments.lab.outcomes import Outcome, WrongSpan
from codra_papers.experiments.lab.run import LabSettings, run_lab
from codra_papers.experiments.lab.scoring import Piece
from codra_papers.experiments.lab.spec_variants import WithoutAlternatives
from codra_papers.experiments.lab.trials import Trial, run_trial, value_at
from codra_papers.experiments.studies import lab_disturbances
from codra_papers.experiments.studies.beyond.complementary import (
    VARIABLE,
    Knowledge,
    knowledge,
    knowledge_sentence,
    knowledge_table,
    out_of_view,
)
from codra_papers.experiments.studies.beyond.workloads import Tending, Waiting
from codra_papers.experiments.studies.lab_disturbances import PLACES, episodes
from codra_papers.lab.simulator.laboratory import LABORATORY, LidMoved

SPEC = Path(__file__).parents[4] / "specs" / "lab.yaml"
PAIR = (PRECONDITIONS, PRECONDITIONS_ALTERNATIVES)
OPENED_S, DURATION_S = 32.0, 50.0
STEP_S = 0.02


def trial(*arms: Arm) -> Trial:
    """Return a run in which somebody opens the centrifuge's lid, which moves it out of the camera's view."""
    opened = LidMoved(at_s=OPENED_S, machine="centrifuge", open_share=1.0)
    return Trial(
        name="opened",
        spec=SPEC,
        seed=7,
        arms=arms,
        laboratory=replace(LABORATORY, disturbances=(opened,)),
        work=Tending(machines=("centrifuge",)),
        duration_s=DURATION_S,
    )


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    return run_trial(trial(*PAIR), tmp_path_factory.mktemp("opened"))


def findings(outcome: Outcome) -> dict[tuple[str, str], Knowledge]:
    situations = {"out of view": out_of_view, "in time": partial(out_of_view, end_s=40.0)}
    found = knowledge([outcome], situations, alternatives(read_spec(SPEC))[VARIABLE])
    return {(finding.situation, finding.arm): finding for finding in found}


def test_a_lid_that_is_opened_and_out_of_view_is_known_to_be_open_only_with_the_alternative(outcome: Outcome) -> None:
    held = {arm.name: outcome.arms[arm.name].held[VARIABLE][-1].value for arm in PAIR}
    with_alternatives = outcome.arms[PRECONDITIONS_ALTERNATIVES.name]

    assert [piece.value for piece in outcome.truth[VARIABLE]] == [False, True]
    assert held == {PRECONDITIONS.name: False, PRECONDITIONS_ALTERNATIVES.name: True}
    assert with_alternatives.sources[VARIABLE][-1].value == "see_centrifuge_rotor"


def test_seconds_out_of_view_equal_those_of_sampling(outcome: Outcome) -> None:
    truth = outcome.truth
    instants = [STEP_S * (number + 0.5) for number in range(int(DURATION_S / STEP_S))]
    hidden = [
        instant_s
        for instant_s in instants
        if value_at(truth["centrifuge_in_observable_distance"], instant_s)
        and not value_at(truth["centrifuge_lid_in_FOV"], instant_s)
    ]
    for (situation, arm), finding in findings(outcome).items():
        counted = [instant_s for instant_s in hidden if situation == "out of view" or instant_s < 40.0]
        held = [value_at(outcome.arms[arm].held[VARIABLE], instant_s) for instant_s in counted]
        right = [value == value_at(truth[VARIABLE], at_s) for value, at_s in zip(held, counted, strict=True)]
        sources = [value_at(outcome.arms[arm].sources[VARIABLE], instant_s) for instant_s in counted]

        assert finding.seconds.strict_share.total == pytest.approx(STEP_S * len(counted), abs=0.1)
        assert finding.seconds.right_s == pytest.approx(STEP_S * sum(right), abs=0.1)
        assert finding.seconds.unknown_s == pytest.approx(STEP_S * held.count(None), abs=0.1)
        assert finding.in_use.strict_share.total == pytest.approx(
            STEP_S * sources.count("see_centrifuge_rotor"), abs=0.1
        )


def test_the_report_states_how_much_more_is_right_with_the_alternative(outcome: Outcome) -> None:
    by_arm = findings(outcome)
    with_alternatives, without = (by_arm["out of view", arm.name] for arm in reversed(PAIR))
    table = knowledge_table(list(by_arm.values()), "All runs.")

    assert with_alternatives.more_right is not None
    assert with_alternatives.more_right.value == pytest.approx(
        (with_alternatives.seconds.right_s - without.seconds.right_s) / without.seconds.strict_share.total
    )
    assert without.more_right is None
    assert f"{with_alternatives.jobs} of '{PRECONDITIONS_ALTERNATIVES.name}'" in table.caption
    assert without.jobs == 0 < with_alternatives.jobs
    assert {len(row) for row in table.rows} == {len(table.header)}
    assert PRECONDITIONS.name in knowledge_sentence(list(by_arm.values()), "out of view")


def test_a_spec_without_alternatives_gives_a_report_in_which_none_is_in_use(outcome: Outcome) -> None:
    arms = {name: replace(arm, sources={}) for name, arm in outcome.arms.items()}
    found = knowledge([replace(outcome, arms=arms)], {"out of view": out_of_view}, ())

    assert {finding.in_use.strict_share.total for finding in found} == {0.0}
    assert "complete runs: none" in knowledge_table(found, "All runs.").caption


def test_a_value_is_a_mistake_of_the_alternative_only_if_its_evidence_was_wrong(outcome: Outcome) -> None:
    name = PRECONDITIONS_ALTERNATIVES.name
    never_open = replace(outcome, truth={**outcome.truth, VARIABLE: (Piece(0.0, DURATION_S, False),)})
    spans = [
        WrongSpan(piece.start_s, piece.end_s, was_true=False)
        for piece in outcome.arms[name].held[VARIABLE]
        if piece.value
    ]
    mistaken_arm = replace(outcome.arms[name], wrong={VARIABLE: spans})
    mistaken = replace(never_open, arms={**outcome.arms, name: mistaken_arm})

    right, wrong = (findings(run)["out of view", name] for run in (outcome, mistaken))

    assert right.seen_wrongly_s == 0.0
    assert wrong.seen_wrongly_s == pytest.approx(wrong.in_use.wrong_s)
    assert wrong.seen_wrongly_s > 5.0


@pytest.mark.parametrize("arm", [PRECONDITIONS_ALTERNATIVES, ALTERNATIVES])
def test_the_arms_of_a_pair_differ_only_in_their_alternatives(arm: Arm) -> None:
    arms = {other.name: other for other in (PRECONDITIONS, NEED_ON_EVENT)}
    other_arm = arms[WITHOUT_ALTERNATIVES[arm.name]]
    specs = []
    for edits in ((*arm.edits, WithoutAlternatives()), other_arm.edits):
        spec = read_spec(SPEC)
        for edit in edits:
            spec = edit(spec)
        specs.append(spec)

    assert arm.need is other_arm.need
    assert specs[0] == specs[1]


def test_an_arm_is_not_affected_by_an_arm_with_alternatives(outcome: Outcome, tmp_path: Path) -> None:
    alone = run_trial(trial(PRECONDITIONS), tmp_path)

    assert alone.arms[PRECONDITIONS.name] == outcome.arms[PRECONDITIONS.name]
    assert alone.truth == outcome.truth


def test_a_robot_that_waits_with_its_arm_drawn_back_does_not_see_the_open_lid_and_closes_it_in_the_end() -> None:
    run = run_lab([], LabSettings(seed=7, work=Waiting(machine="centrifuge", until_s=500.0, draws_back=True)))
    lid_in_view = {value_at(run.truth["centrifuge_lid_in_FOV"], instant_s) for instant_s in (450.0, 475.0, 499.0)}

    assert [piece.value for piece in run.truth["centrifuge_open"]] == [False, True, False]
    assert lid_in_view == {False}
    assert run.error is None


def test_the_same_disturbances_happen_at_both_places_and_both_pairs_watch_the_centrifuge() -> None:
    (pcr_cycler, centrifuge) = PLACES
    times_s = [
        [(episode.start_s, episode.until_s, len(episode.disturbances)) for episode in episodes(place.machine)]
        for place in PLACES
    ]

    assert (pcr_cycler.machine, centrifuge.machine) == ("pcr_cycler", "centrifuge")
    assert times_s[0] == times_s[1]
    assert {name for pair in WITHOUT_ALTERNATIVES.items() for name in pair} < {arm.name for arm in centrifuge.arms}
    assert not {arm.name for arm in pcr_cycler.arms} & set(WITHOUT_ALTERNATIVES)


def test_the_report_has_each_disturbance_at_both_places_and_the_complementary_observers(tmp_path: Path) -> None:
    settings = Settings(spec=SPEC, seeds=1, folder=tmp_path)
    trials = [replace(lab_disturbances.trial(settings, place, 7), duration_s=12.0) for place in PLACES]
    outcomes = {short.name: run_trial(short, tmp_path / short.name) for short in trials}
    document = lab_disturbances.judge(settings, outcomes)
    titles = [section.title for section in document.sections]
    parts = [part for section in document.sections for part in section.parts]

    assert document == lab_disturbances.judge(settings, outcomes)
    assert json.loads(json.dumps(document.results, allow_nan=False))
    assert len([title for title in titles if title.startswith("At the PCR-cycler: ")]) == 7
    assert len([title for title in titles if title.startswith("At the centrifuge: ")]) == 7
    assert titles[1] == "Complementary observers"
    assert len([part for part in parts if isinstance(part, Drawing)]) == 4
    for table in parts:
        if isinstance(table, Table):
            assert {len(row) for row in table.rows} <= {len(table.header)}
