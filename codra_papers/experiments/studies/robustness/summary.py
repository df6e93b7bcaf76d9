"""What was found, in sentences that answer the questions of the protocol, whatever the answer is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from codra_papers.experiments.campaign.cells import interval, percent
from codra_papers.experiments.campaign.statistics import Estimate, Share, ratio_of_sums
from codra_papers.experiments.lab.arms import NAIVE, NEED, NEED_ON_EVENT, PRECONDITIONS
from codra_papers.experiments.studies.robustness.findings import (
    PCR_CYCLER_LID,
    VARIABLES,
    Comparison,
    Runs,
    fewer_triggers,
    label,
)
from codra_papers.experiments.studies.robustness.frames import DetectedAgain
from codra_papers.experiments.studies.robustness.mistakes import Mistake

HOPED_RATIO = 0.985
"""Of `centrifuge_open` with preconditions, in P1's counting: told of each arm that has them."""

HOPED_REDUCTION = 0.9
"""Of triggers, with need and on event, against the naive arm."""

CONTEXT_DRIVEN = (PRECONDITIONS.name, NEED.name, NEED_ON_EVENT.name)


def ratio_sentences(runs: Runs, comparisons: Sequence[Comparison]) -> Iterator[str]:
    """Answer whether context makes observers steadier."""
    yield _hope_for_the_ratio(runs)
    for arm in CONTEXT_DRIVEN:
        for one in comparisons:
            if (one.variable, one.arm, one.against) == ("centrifuge_open", arm, NAIVE.name):
                yield (
                    f"centrifuge_open, {arm} against {NAIVE.name} over {_count(one.runs, 'further run')}: ratio "
                    f"{interval(one.paper)}, {_better(one.paper)}; strict ratio {interval(one.strict)}, "
                    f"{_better(one.strict)}."
                )
    for arm in CONTEXT_DRIVEN:
        for one in comparisons:
            if (one.variable, one.arm, one.against) == ("pcr_cycler_open", arm, NAIVE.name):
                yield (
                    f"PCR-cycler_open, {arm} against {NAIVE.name} over {_count(one.runs, 'further run')}: ratio "
                    f"{interval(one.paper)}, {_not_worse(one.paper)}; strict ratio {interval(one.strict)}, "
                    f"{_not_worse(one.strict)}."
                )


def _hope_for_the_ratio(runs: Runs) -> str:
    reached = {arm: runs.total("centrifuge_open", arm) for arm in runs.arms}
    told = ", ".join(
        f"{_number(ratio_of_sums([found.paper]))} (strict {_number(ratio_of_sums([found.strict]))}) with {arm}"
        for arm, found in reached.items()
    )
    outcomes = "; ".join(f"{arm} {_hope(ratio_of_sums([reached[arm].paper]))}" for arm in CONTEXT_DRIVEN)
    return (
        f"centrifuge_open over {_count(len(runs.outcomes), 'run')}: ratio {told}. "
        f"Hoped for: at least {HOPED_RATIO}; {outcomes}."
    )


def _hope(found: float | None) -> str:
    return "gives no ratio" if found is None else "reaches it" if found >= HOPED_RATIO else "does not reach it"


def _better(found: Estimate) -> str:
    if found.is_positive:
        return "better, with the interval above zero"
    if found.is_negative:
        return "worse, with the interval below zero"
    return "not shown to differ"


def _not_worse(found: Estimate) -> str:
    return _better(found) if found.is_positive or found.is_negative else "not shown to be worse or better"


def trigger_sentences(runs: Runs, vision: Sequence[str]) -> Iterator[str]:
    """Answer how many triggers need and events save, and what the rest goes into."""
    for arm in CONTEXT_DRIVEN:
        lid, every = (fewer_triggers(runs, arm, NAIVE.name, names) for names in (PCR_CYCLER_LID, vision))
        yield (
            f"{arm} triggers the PCR-cycler's lid {percent(lid)} % less often than {NAIVE.name} (P1: 79.4 %), "
            f"and all perception that needs the vision slot {percent(every)} %."
        )
    yield _hope_for_the_triggers(runs, vision)


def _hope_for_the_triggers(runs: Runs, vision: Sequence[str]) -> str:
    arm = NEED_ON_EVENT.name
    found = fewer_triggers(runs, arm, NAIVE.name, vision).value
    counts = {name: sum(runs.triggers(arm, (name,))) for name in vision}
    most = max(counts, key=lambda name: counts[name])
    if found is not None and found >= HOPED_REDUCTION:
        return f"Hoped for: {100 * HOPED_REDUCTION:.0f} % fewer with need and on event; this is reached."
    return (
        f"Hoped for: {100 * HOPED_REDUCTION:.0f} % fewer with need and on event; this is not reached. Of the "
        f"{sum(counts.values())} that are left, {counts[most]} are of {most}."
    )


def cause_sentences(runs: Runs) -> Iterator[str]:
    """Tell why held values were wrong, as far as the evidence tells."""
    for variable in ("centrifuge_open", "pcr_cycler_open"):
        told = []
        for arm in runs.arms:
            found = runs.causes((variable,), arm)
            seen, changed = found.seen_wrongly_s, found.changed_since_s
            told.append(f"{arm} {seen + changed:.0f} s ({seen:.0f} s seen wrongly, {changed:.0f} s changed since)")
        yield f"Seconds with a wrong {label(variable)}: {'; '.join(told)}."
        yield _without_lag(runs, variable)


def _without_lag(runs: Runs, variable: str) -> str:
    """Tell what the ratio were if only what was seen wrongly counted: what perception itself is to blame for."""
    told = []
    for arm in runs.arms:
        wrong_s, right_s = runs.causes((variable,), arm).seen_wrongly_s, runs.whole(variable, arm).right_s
        told.append(f"{_number(ratio_of_sums([Share(right_s, right_s + wrong_s)]))} with {arm}")
    lag_s = {arm: runs.lags(variable, arm).quantile_s(0.5) for arm in runs.arms}
    slow = ", ".join("never" if found is None else f"{found:.0f} s" for found in lag_s.values())
    return (
        f"If only what was seen wrongly counted as wrong, the ratio of {label(variable)} over whole runs were "
        f"{', '.join(told)}; the median lag after a change is {slow}, in the same order."
    )


def decision_sentences(runs: Runs, found: Sequence[Mistake]) -> Iterator[str]:
    """Tell how often a decision would have been made on a wrong value."""
    counts = {
        arm: tuple(
            sum(mistake.arm == arm and mistake.purpose == purpose for mistake in found)
            for purpose in ("preview", "monitoring")
        )
        for arm in runs.arms
    }
    asked = sum(decision.variable in VARIABLES for outcome in runs.outcomes for decision in outcome.decisions)
    told = ", ".join(f"{arm} {sum(both)} ({both[0]} previews)" for arm, both in counts.items())
    yield f"Of {asked} decisions on the fourteen variables, an arm held a wrong value at: {told}."


def frame_sentences(runs: Runs, again: Sequence[DetectedAgain]) -> Iterator[str]:
    """Tell whether what was perceived can be perceived again."""
    told = [(outcome.frames, outcome.perceived) for outcome in runs.outcomes]
    rendered, perceived = (sum(each) for each in zip(*told, strict=True)) if told else (0, 0)
    equal = all(left == right for left, right in told)
    yield (
        f"{rendered} frames were rendered and {perceived} perceived, "
        f"{'equal in each run' if equal else 'not equal in each run'}. {_count(len(again), 'kept frame')} detected "
        f"again from the files alone: {sum(one.agrees for one in again)} gave exactly the recorded evidence."
    )


def _number(value: float | None) -> str:
    return "none" if value is None else f"{value:.3f}"


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
