"""`lab-disturbances`: what do observers believe when somebody interferes, and how soon are they right again?"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from codra_dsl.integrations.inspection import read_spec
from codra_papers.experiments.campaign.cells import interval, plain_table, rounded
from codra_papers.experiments.campaign.document import Cell, Document, Section, Table, Words
from codra_papers.experiments.campaign.experiment import Experiment, Settings
from codra_papers.experiments.campaign.statistics import Estimate, mean_interval
from codra_papers.experiments.lab.algorithms import alternatives
from codra_papers.experiments.lab.arms import (
    ALTERNATIVES,
    NAIVE,
    NAIVE_PACED,
    NEED,
    NEED_ON_EVENT,
    PRECONDITIONS,
    PRECONDITIONS_ALTERNATIVES,
    Arm,
)
from codra_papers.experiments.lab.metrics import Seconds, seconds, total
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.lab.scoring import Piece, overlaps
from codra_papers.experiments.lab.trials import Trial
from codra_papers.experiments.studies.beyond.arm_comparison import reported_seeds, runs_sentence
from codra_papers.experiments.studies.beyond.complementary import (
    VARIABLE,
    SpanFunction,
    knowledge,
    knowledge_as_data,
    knowledge_sentence,
    knowledge_table,
    out_of_view,
)
from codra_papers.experiments.studies.beyond.workloads import Waiting
from codra_papers.experiments.studies.robustness import drawings
from codra_papers.experiments.studies.robustness.findings import label
from codra_papers.experiments.studies.robustness.tables import arms_table
from codra_papers.lab.mission import CENTRIFUGE, PCR_CYCLER
from codra_papers.lab.simulator.laboratory import LABORATORY, Disturbance, LidMoved, LightDown, PersonBefore


@dataclass(frozen=True, slots=True, kw_only=True)
class Episode:
    """A disturbance and the quiet time after it.

    Attributes:
        start_s: when the disturbance begins.
        disturbance_end_s: when the disturbance is over.
        until_s: the end of the quiet time, in which beliefs are still judged.
    """

    name: str
    start_s: float
    disturbance_end_s: float
    until_s: float
    disturbances: tuple[Disturbance, ...]


def episodes(machine: str) -> tuple[Episode, ...]:
    """Return the episodes beside a machine, which are at the same instants in every run.

    Before the first episode, there is time to repair one or two failed actions.
    """
    return (
        Episode(
            name="the light goes down",
            start_s=800.0,
            disturbance_end_s=861.0,
            until_s=940.0,
            disturbances=(LightDown(at_s=800.0, lasts_s=60.0, light=0.02),),
        ),
        Episode(
            name="a person stands before the camera",
            start_s=940.0,
            disturbance_end_s=1002.0,
            until_s=1080.0,
            disturbances=(PersonBefore(at_s=940.0, lasts_s=60.0),),
        ),
        Episode(
            name="somebody closes the lid",
            start_s=1080.0,
            disturbance_end_s=1083.0,
            until_s=1160.0,
            disturbances=(LidMoved(at_s=1080.0, machine=machine, open_share=0.0),),
        ),
        Episode(
            name="somebody opens the lid",
            start_s=1160.0,
            disturbance_end_s=1163.0,
            until_s=1240.0,
            disturbances=(LidMoved(at_s=1160.0, machine=machine, open_share=1.0),),
        ),
        Episode(
            name="behind a person, somebody closes the lid",
            start_s=1240.0,
            disturbance_end_s=1302.0,
            until_s=1380.0,
            disturbances=(
                PersonBefore(at_s=1240.0, lasts_s=60.0),
                LidMoved(at_s=1260.0, machine=machine, open_share=0.0),
            ),
        ),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """A machine beside which the robot waits, and the arms that watch.

    Attributes:
        draws_back: whether the robot waits with its arm drawn back; otherwise the camera shows the complete machine.
        watched: the reported variables: first the one that somebody changes, last the one that is drawn beside it.
    """

    machine: str
    arms: tuple[Arm, ...]
    draws_back: bool
    watched: tuple[str, ...]

    def outcomes_in(self, outcomes: Mapping[str, Outcome]) -> Sequence[Outcome]:
        """Return the outcomes of the trials at this place."""
        return [outcome for name, outcome in outcomes.items() if name.startswith(self.machine)]


AT_PCR_CYCLER = Place(
    machine=PCR_CYCLER,
    arms=(NAIVE, NAIVE_PACED, PRECONDITIONS, NEED, NEED_ON_EVENT),
    draws_back=False,
    watched=tuple(f"{PCR_CYCLER}_{name}" for name in ("open", "locked", "lid_in_FOV", "base_in_FOV")),
)
AT_CENTRIFUGE = Place(
    machine=CENTRIFUGE,
    arms=(NAIVE, PRECONDITIONS, PRECONDITIONS_ALTERNATIVES, NEED_ON_EVENT, ALTERNATIVES),
    draws_back=True,
    watched=(f"{CENTRIFUGE}_open", f"{CENTRIFUGE}_lid_in_FOV"),
)
"""Only the centrifuge has a variable with an alternative. While the arm is drawn back, its open lid is out of view."""

PLACES = (AT_PCR_CYCLER, AT_CENTRIFUGE)

_NOTE = (
    "The robot opens a machine and waits beside it. Then all arms of the experiment see the same disturbances. At the "
    "end the robot closes the machine if it is open. At the PCR-cycler, the camera sees the complete machine. At the "
    "centrifuge, the arm is drawn back: the camera sees a closed lid, but an open lid is out of view, and only the "
    "rotor in the machine shows that the lid is open. The robot looks by itself for each of its decisions. No arm is "
    "informed of a disturbance. Disturbances follow one another, so an arm that never noticed that the lid was closed "
    "is right again, without a new observation, when somebody opens the lid."
)


def trials(settings: Settings) -> Sequence[Trial]:
    """Return one run per seed and place. Each run has all disturbances."""
    return [trial(settings, place, seed) for place in PLACES for seed in reported_seeds(settings)]


def trial(settings: Settings, place: Place, seed: int) -> Trial:
    """Return the run of one seed at one place."""
    place_episodes = episodes(place.machine)
    disturbances = tuple(disturbance for episode in place_episodes for disturbance in episode.disturbances)
    return Trial(
        name=f"{place.machine}-{seed}",
        spec=settings.spec,
        seed=seed,
        arms=place.arms,
        laboratory=replace(LABORATORY, disturbances=disturbances),
        work=Waiting(machine=place.machine, until_s=place_episodes[-1].until_s, draws_back=place.draws_back),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Belief:
    """The values of a variable that an arm held in one episode, over runs.

    Attributes:
        seconds_during: how long the values were right, wrong and unknown while the disturbance lasted.
        seconds_after: the same, from the end of the disturbance to the end of the episode.
        right_again_s: for each run, the time from the beginning of the disturbance until the arm was right and stayed
            right; None if the arm was not right at the end of the episode.
    """

    episode: Episode
    variable: str
    arm: str
    seconds_during: Seconds
    seconds_after: Seconds
    right_again_s: Sequence[float | None]


def belief_in(outcomes: Sequence[Outcome], episode: Episode, variable: str, arm: str) -> Belief:
    """Return the values that an arm held in an episode. Runs that ended before the end of the episode are left out."""
    pairs = [
        (outcome.arms[arm].held[variable], outcome.truth[variable])
        for outcome in outcomes
        if outcome.duration_s >= episode.until_s
    ]
    return Belief(
        episode=episode,
        variable=variable,
        arm=arm,
        seconds_during=total(
            _seconds_within(held, truth, episode.start_s, episode.disturbance_end_s) for held, truth in pairs
        ),
        seconds_after=total(
            _seconds_within(held, truth, episode.disturbance_end_s, episode.until_s) for held, truth in pairs
        ),
        right_again_s=[right_again_s(held, truth, episode.start_s, episode.until_s) for held, truth in pairs],
    )


def _seconds_within(held: Sequence[Piece], truth: Sequence[Piece], start_s: float, end_s: float) -> Seconds:
    truth_until_end = [
        Piece(piece.start_s, min(piece.end_s, end_s), piece.value) for piece in truth if piece.start_s < end_s
    ]
    return seconds(held, truth_until_end, start_s)


def right_again_s(held: Sequence[Piece], truth: Sequence[Piece], start_s: float, end_s: float) -> float | None:
    """Return how long after `start_s` a held value became right and stayed right until `end_s`.

    Return None if the value was not right at `end_s`. An unknown value is not right.
    """
    right_since_s = start_s
    for piece, fact, _ in overlaps(held, truth):
        until_s = min(piece.end_s, fact.end_s, end_s)
        if until_s > right_since_s and max(piece.start_s, fact.start_s) < end_s and piece.value != fact.value:
            right_since_s = until_s
    return None if right_since_s >= end_s else right_since_s - start_s


def judge(settings: Settings, outcomes: Mapping[str, Outcome]) -> Document:
    """Return the report on the outcomes of `trials`.

    Raises:
        SpecError: if the spec has errors.
    """
    runs = {place: place.outcomes_in(outcomes) for place in PLACES}
    beliefs = {place: _beliefs(place, place_runs) for place, place_runs in runs.items()}
    alternative_names = alternatives(read_spec(settings.spec)).get(VARIABLE, ())
    findings = knowledge(runs[AT_CENTRIFUGE], _situations(), alternative_names)
    return Document(
        title="lab-disturbances: what observers believe when somebody else interferes",
        summary=(
            *(sentence for place in PLACES for sentence in _summary(place, beliefs[place])),
            *(knowledge_sentence(findings, situation) for situation in (_OUT_OF_VIEW_QUIET, _OUT_OF_VIEW)),
            runs_sentence(list(outcomes.values())),
        ),
        sections=(
            Section(title="Runs", parts=(Words(text=_NOTE),)),
            Section(
                title="Complementary observers",
                parts=(Words(text=_ALTERNATIVES_NOTE), knowledge_table(findings, "The centrifuge, over all runs.")),
            ),
            *(section for place in PLACES for section in _sections(place, beliefs[place], runs[place])),
        ),
        results={
            **{place.machine: _beliefs_as_data(place, beliefs[place]) for place in PLACES},
            "complementary_observers": knowledge_as_data(findings),
        },
    )


def _beliefs(place: Place, outcomes: Sequence[Outcome]) -> Sequence[Belief]:
    return [
        belief_in(outcomes, episode, name, arm.name)
        for episode in episodes(place.machine)
        for name in place.watched
        for arm in place.arms
    ]


_ALTERNATIVES_NOTE = (
    "While the lid is out of view, the algorithm that measures the angle of the lid cannot look. Then the alternative "
    "looks for tags of the rotor, which a closed lid hides. An arm with alternatives and the arm without them differ "
    "in nothing else, and watch the same frames. The lid is out of view while the robot is near the centrifuge and "
    "less than half of the corners of the lid's tags are in the image. An arm that missed that the lid was opened is "
    "right by accident when somebody closes the lid again."
)

_OUT_OF_VIEW, _OUT_OF_VIEW_QUIET = "Lid out of view", "Lid out of view, undisturbed"


def _situations() -> Mapping[str, SpanFunction]:
    place_episodes = episodes(CENTRIFUGE)
    return {
        _OUT_OF_VIEW_QUIET: partial(out_of_view, end_s=place_episodes[0].start_s),
        _OUT_OF_VIEW: out_of_view,
        **{episode.name.capitalize(): partial(_whole_episode, episode) for episode in place_episodes},
    }


def _whole_episode(episode: Episode, outcome: Outcome) -> Sequence[Piece]:
    """Return the span of an episode. As in `belief_in`, a run that ended before the end of the episode is left out."""
    return [Piece(episode.start_s, episode.until_s, None)] if outcome.duration_s >= episode.until_s else []


def _sections(place: Place, beliefs: Sequence[Belief], outcomes: Sequence[Outcome]) -> Iterator[Section]:
    title = f"At the {label(place.machine)}"
    yield Section(title=f"{title}: arms", parts=(arms_table(place.arms),))
    for episode in episodes(place.machine):
        yield _section(f"{title}: {episode.name}", episode, [belief for belief in beliefs if belief.episode == episode])
    caption = "The true value and the value of each arm. The background is coloured while the value is wrong."
    events = {episode.name: episode.start_s for episode in episodes(place.machine)}
    names = (place.watched[0], place.watched[-1])
    parts = tuple(drawings.timeline(outcomes[0], name, caption, events) for name in names)
    yield Section(title=f"{title}: one run over time", parts=parts)


def _section(title: str, episode: Episode, beliefs: Sequence[Belief]) -> Section:
    caption = (
        f"Seconds over all runs, during the disturbance ({episode.start_s:g} s to {episode.disturbance_end_s:g} s) and "
        f"after it (to {episode.until_s:g} s). Seconds with a wrong value are marked."
    )
    rows = [_seconds_row(belief) for belief in beliefs]
    header = ("variable", "arm", "during: right s", "wrong s", "unknown s", "after: right s", "wrong s", "unknown s")
    marked = frozenset((row, column) for row, cells in enumerate(rows) for column in (3, 6) if cells[column])
    right_again_table = plain_table(
        "Right again: the mean time from the beginning of the disturbance until the arm was right and stayed right, "
        "over the runs in which this happened before the next disturbance; an unknown value is not right. Minus naive: "
        "the difference to naive observers, with 95 % intervals over the runs in which both arms were right again.",
        ("variable", "arm", "right again s", "minus naive s", "runs never right again"),
        [_right_again_row(belief, _naive_belief(beliefs, belief.variable)) for belief in beliefs],
    )
    parts = (Table(caption=caption, header=header, rows=rows, marked=marked), right_again_table)
    return Section(title=title, parts=parts)


def _seconds_row(belief: Belief) -> Sequence[Cell]:
    during, after = belief.seconds_during, belief.seconds_after
    return (
        label(belief.variable),
        belief.arm,
        *(round(duration_s, 1) for duration_s in (during.right_s, during.wrong_s, during.unknown_s)),
        *(round(duration_s, 1) for duration_s in (after.right_s, after.wrong_s, after.unknown_s)),
    )


def _right_again_row(belief: Belief, naive: Belief) -> Sequence[Cell]:
    durations_s = [duration_s for duration_s in belief.right_again_s if duration_s is not None]
    return (
        label(belief.variable),
        belief.arm,
        rounded(math.fsum(durations_s) / len(durations_s), 1) if durations_s else None,
        None if belief.arm == naive.arm else interval(_delay_against(belief, naive), 1),
        len(belief.right_again_s) - len(durations_s),
    )


def _naive_belief(beliefs: Sequence[Belief], variable: str) -> Belief:
    return next(belief for belief in beliefs if belief.variable == variable and belief.arm == NAIVE.name)


def _delay_against(belief: Belief, other: Belief) -> Estimate:
    """Return how much later one arm was right again than another, over the runs in which both were right again."""
    pairs = zip(belief.right_again_s, other.right_again_s, strict=True)
    delays_s = [own_s - other_s for own_s, other_s in pairs if own_s is not None and other_s is not None]
    return mean_interval(delays_s) if delays_s else Estimate(value=None, low=None, high=None)


def _summary(place: Place, beliefs: Sequence[Belief]) -> Iterator[str]:
    lid = place.watched[0]
    for episode in episodes(place.machine):
        lid_beliefs = [belief for belief in beliefs if belief.episode == episode and belief.variable == lid]
        episode_text = f"{episode.name.capitalize()}, {len(lid_beliefs[0].right_again_s)} runs"
        if not any(_wrong_s(belief) for belief in lid_beliefs):
            yield f"{episode_text}: no arm was wrong about {label(lid)} at any time."
        else:
            beliefs_text = "; ".join(
                f"{belief.arm}, {_wrong_s(belief):.0f} s wrong, {_right_again_text(belief)}" for belief in lid_beliefs
            )
            yield f"{episode_text}, {label(lid)}: {beliefs_text}."


def _wrong_s(belief: Belief) -> float:
    return belief.seconds_during.wrong_s + belief.seconds_after.wrong_s


def _right_again_text(belief: Belief) -> str:
    durations_s = [duration_s for duration_s in belief.right_again_s if duration_s is not None]
    never_count = len(belief.right_again_s) - len(durations_s)
    text = f"right again after {math.fsum(durations_s) / len(durations_s):.1f} s" if durations_s else "not right again"
    return (
        f"{text} (never in {never_count} of {len(belief.right_again_s)} runs)" if durations_s and never_count else text
    )


def _beliefs_as_data(place: Place, beliefs: Sequence[Belief]) -> Mapping[str, Any]:
    return {
        episode.name: [_as_data(belief) for belief in beliefs if belief.episode == episode]
        for episode in episodes(place.machine)
    }


def _as_data(belief: Belief) -> Mapping[str, Any]:
    return {
        "variable": label(belief.variable),
        "arm": belief.arm,
        "during_s": {
            "right": belief.seconds_during.right_s,
            "wrong": belief.seconds_during.wrong_s,
            "unknown": belief.seconds_during.unknown_s,
        },
        "after_s": {
            "right": belief.seconds_after.right_s,
            "wrong": belief.seconds_after.wrong_s,
            "unknown": belief.seconds_after.unknown_s,
        },
        "right_again_s": list(belief.right_again_s),
    }


EXPERIMENT = Experiment(
    name="lab-disturbances",
    question="What do observers believe when somebody else interferes, and how soon are they right again?",
    seeds=10,
    trials=trials,
    judge=judge,
)
