"""The runs: the same work with the same seed, without observers and with them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from codra_papers.experiments.campaign.experiment import FIRST_REPORTED_SEED, Settings
from codra_papers.experiments.lab.arms import ALTERNATIVES, NEED_ON_EVENT, Arm
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.lab.run import Loops
from codra_papers.experiments.lab.trials import Trial
from codra_papers.experiments.studies.factors.design import NAIVE_LIDS
from codra_papers.experiments.studies.lab_runtime.executions import Execution, Task, executions
from codra_papers.experiments.studies.lab_runtime.paper import DAY_S, EXECUTION_COUNT
from codra_papers.lab.mission import PCR_CYCLER, Mission

DECISION_S = 0.02
"""The time that a decision request takes: more than the 99th percentile that `benchmarks/deciding.py` measured from
another process (docs/papers/lab-runtime.md)."""

REPAIR_S = 120.0
"""How long a repair after an unrecoverable error takes. P1's day had minor interruptions as well."""

WITHOUT_OBSERVERS, WITH_OBSERVERS, WITH_ALTERNATIVES = "without-observers", "with-observers", "with-alternatives"


@dataclass(frozen=True, slots=True)
class OpenAndClose:
    """Drive to the PCR-cycler, then open and close it several times."""

    times: int

    def __call__(self, mission: Mission) -> None:
        """Drive, open and close."""
        mission.open_and_close(PCR_CYCLER, self.times)


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """The same work with the same seed, without observers and with them."""

    seed: int
    without: Outcome
    observed: Outcome

    def executions_of(self, task: Task) -> tuple[Sequence[Execution], Sequence[Execution]]:
        """Return the executions of a task, without observers and with them."""
        without, observed = (
            [execution for execution in executions(outcome) if execution.task is task]
            for outcome in (self.without, self.observed)
        )
        return without, observed


def trials(settings: Settings) -> Sequence[Trial]:
    """Return all runs: those of P1's sample, those of the further seeds, and those of the day."""
    return [
        *(trial for seed in _seeds(settings) for trial in tending_trials(settings, seed)),
        *day_trials(settings),
        alternatives_trial(settings),
    ]


def tending_trials(settings: Settings, seed: int, times: int = EXECUTION_COUNT) -> Sequence[Trial]:
    """Return the two runs in which the PCR-cycler is opened and closed (P1, section 4.2)."""
    trial = Trial(
        name=f"tending-{seed}",
        spec=settings.spec,
        seed=seed,
        arms=(),
        decision_s=DECISION_S,
        work=OpenAndClose(times),
    )
    return list(_trial_pair(trial))


def day_trials(settings: Settings, duration_s: float = DAY_S) -> Sequence[Trial]:
    """Return the two runs of a day at the fair: the robot processes sample after sample, and continues after errors.

    Further arms watch the day with observers, as P1's naive observers did, and answer nothing.
    """
    return list(_trial_pair(_day_trial(settings, duration_s), watching=(NAIVE_LIDS, ALTERNATIVES)))


def alternatives_trial(settings: Settings, duration_s: float = DAY_S) -> Trial:
    """Return the run of the day with observers and with the alternatives of the spec."""
    return _asking(_day_trial(settings, duration_s), WITH_ALTERNATIVES, ALTERNATIVES)


def _day_trial(settings: Settings, duration_s: float) -> Trial:
    return Trial(
        name="day",
        spec=settings.spec,
        seed=FIRST_REPORTED_SEED,
        arms=(),
        decision_s=DECISION_S,
        repair_s=REPAIR_S,
        work=Loops(),
        duration_s=duration_s,
    )


def tending_pairs(settings: Settings, outcomes: Mapping[str, Outcome]) -> Sequence[Pair]:
    """Return a pair of outcomes for each seed, without the runs of the day. The first pair is P1's sample."""
    return [_pair(f"tending-{seed}", outcomes) for seed in _seeds(settings)]


def day_pair(outcomes: Mapping[str, Outcome]) -> Pair:
    """Return the pair of outcomes of the day."""
    return _pair("day", outcomes)


def alternatives_day(outcomes: Mapping[str, Outcome]) -> Outcome:
    """Return the outcome of the day with alternatives."""
    return outcomes[f"day-{WITH_ALTERNATIVES}"]


def _seeds(settings: Settings) -> Sequence[int]:
    return range(FIRST_REPORTED_SEED, FIRST_REPORTED_SEED + 1 + settings.seeds)


def _pair(name: str, outcomes: Mapping[str, Outcome]) -> Pair:
    without, observed = (outcomes[f"{name}-{condition}"] for condition in (WITHOUT_OBSERVERS, WITH_OBSERVERS))
    return Pair(seed=without.seed, without=without, observed=observed)


def _trial_pair(trial: Trial, watching: tuple[Arm, ...] = ()) -> Iterator[Trial]:
    """Yield a run without observers, which has no arms, and a run with an arm that answers the decisions."""
    yield replace(trial, name=f"{trial.name}-{WITHOUT_OBSERVERS}")
    yield _asking(trial, WITH_OBSERVERS, NEED_ON_EVENT, *watching)


def _asking(trial: Trial, condition: str, arm: Arm, *watching: Arm) -> Trial:
    """Return a run in which an arm answers the decisions, and other arms watch."""
    return replace(trial, name=f"{trial.name}-{condition}", arms=(arm, *watching), answering_arm=arm.name)
