"""Complementary observers (P1, contribution 2): what arms know with alternatives by rank, and without them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from codra_papers.experiments.campaign.cells import interval, plain_table, ratio
from codra_papers.experiments.campaign.document import Cell, Table
from codra_papers.experiments.campaign.statistics import Estimate, Share, ratio_difference
from codra_papers.experiments.lab.arms import WITHOUT_ALTERNATIVES
from codra_papers.experiments.lab.metrics import Seconds, seconds, total
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.lab.scoring import Piece, overlaps
from codra_papers.experiments.studies.robustness.findings import estimate_as_data, label
from codra_papers.lab.mission import CENTRIFUGE

VARIABLE = f"{CENTRIFUGE}_open"
"""The variable that has an alternative in `specs/lab.yaml`."""

SpanFunction = Callable[[Outcome], Sequence[Piece]]
"""A function that returns spans of time of a run, in order. The values of the pieces are not used."""


def out_of_view(outcome: Outcome, end_s: float = float("inf")) -> Sequence[Piece]:
    """Return when, before `end_s`, the lid is out of the camera's view although the robot is near the centrifuge."""
    near, lid = (outcome.truth[f"{CENTRIFUGE}_{name}"] for name in ("in_observable_distance", "lid_in_FOV"))
    hidden = _within([piece for piece in lid if not piece.value], [piece for piece in near if piece.value])
    return _within(hidden, [Piece(0.0, end_s, None)])


def _within(pieces: Sequence[Piece], spans: Sequence[Piece]) -> Sequence[Piece]:
    """Return the parts of some pieces that are in some spans."""
    return [
        Piece(max(piece.start_s, span.start_s), min(piece.end_s, span.end_s), piece.value)
        for piece, span, _ in overlaps(pieces, spans)
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class Knowledge:
    """What an arm knew about `VARIABLE` in one situation, over runs.

    Attributes:
        seconds: the seconds in which the held value was right, wrong or unknown.
        in_use: those of these seconds in which the held value had evidence of an alternative.
        seen_wrongly_s: those of the wrong seconds of `in_use` whose value was wrong already in the evidence.
        more_right: the share of right seconds minus that of the arm without alternatives; None for all other arms.
        jobs: how many jobs of alternatives the arm started, over complete runs.
    """

    situation: str
    arm: str
    seconds: Seconds
    in_use: Seconds
    seen_wrongly_s: float
    more_right: Estimate | None
    jobs: int


def knowledge(
    outcomes: Sequence[Outcome], situations: Mapping[str, SpanFunction], alternatives: Sequence[str]
) -> Sequence[Knowledge]:
    """Return what each arm knew in each situation.

    Args:
        outcomes: the outcomes of at least one run, all with the same arms.
        situations: the spans of time of each situation.
        alternatives: the names of the alternatives of `VARIABLE`.
    """
    return [
        _knowledge(situation, [(outcome, spans_of(outcome)) for outcome in outcomes], arm, alternatives)
        for situation, spans_of in situations.items()
        for arm in outcomes[0].arms
    ]


_Runs = Sequence[tuple[Outcome, Sequence[Piece]]]
"""The outcomes of runs, each with the spans of a situation."""


def _knowledge(situation: str, runs: _Runs, arm: str, alternatives: Sequence[str]) -> Knowledge:
    own, other = (_seconds(runs, name) for name in (arm, WITHOUT_ALTERNATIVES.get(arm, arm)))
    sources = [_within(outcome.arms[arm].sources.get(VARIABLE, ()), spans) for outcome, spans in runs]
    runs_in_use = [
        (outcome, [piece for piece in pieces if piece.value in alternatives])
        for (outcome, _), pieces in zip(runs, sources, strict=True)
    ]
    return Knowledge(
        situation=situation,
        arm=arm,
        seconds=total(own),
        in_use=total(_seconds(runs_in_use, arm)),
        seen_wrongly_s=math.fsum(
            duration_s
            for outcome, spans in runs_in_use
            for wrong_span in outcome.arms[arm].wrong[VARIABLE]
            if not wrong_span.was_true
            for _, _, duration_s in overlaps([Piece(wrong_span.start_s, wrong_span.end_s, None)], spans)
        ),
        more_right=ratio_difference([run.strict_share for run in own], [run.strict_share for run in other])
        if arm in WITHOUT_ALTERNATIVES
        else None,
        jobs=sum(outcome.arms[arm].triggers.get(name, 0) for outcome, _ in runs for name in alternatives),
    )


def _seconds(runs: _Runs, arm: str) -> Sequence[Seconds]:
    return [
        seconds(outcome.arms[arm].held[VARIABLE], _within(outcome.truth[VARIABLE], spans)) for outcome, spans in runs
    ]


def knowledge_table(findings: Sequence[Knowledge], caption: str) -> Table:
    """Return a table with a row for each situation and arm."""
    header = ("situation", "arm", "seconds", "known", "right", "wrong", "in use", "wrong s", "mistakes s", "more right")
    jobs = ", ".join(dict.fromkeys(f"{finding.jobs} of '{finding.arm}'" for finding in findings if finding.jobs))
    caption = (
        f"{caption} Known, right, wrong: the shares of these seconds in which the arm held a value of "
        f"{label(VARIABLE)}, a right value, and a wrong value. In use: the share in which the held value had evidence "
        "of the alternative; then, how long such a value was wrong, and how long because of a mistake: the others were "
        "right when their evidence was taken. More right: the share of right values minus that of the same arm without "
        "the alternative, with its 95 % interval over paired runs. Jobs of the "
        f"alternative in complete runs: {jobs or 'none'}."
    )
    return plain_table(caption, header, [tuple(_cells(finding)) for finding in findings])


def _cells(finding: Knowledge) -> Iterator[Cell]:
    all_seconds, all_s = finding.seconds, finding.seconds.strict_share.total
    yield from (finding.situation, finding.arm, round(all_s, 1))
    parts_s = (all_seconds.right_s + all_seconds.wrong_s, all_seconds.right_s, all_seconds.wrong_s)
    yield from (ratio(Share(part_s, all_s)) for part_s in (*parts_s, finding.in_use.strict_share.total))
    yield from (round(finding.in_use.wrong_s, 1), round(finding.seen_wrongly_s, 1))
    yield None if finding.more_right is None else interval(finding.more_right)


def knowledge_sentence(findings: Sequence[Knowledge], situation: str) -> str:
    """Return a sentence about one situation that compares the arms with alternatives with those without them."""
    shares = {finding.arm: finding.seconds.strict_share for finding in findings if finding.situation == situation}
    paired_arms = {arm for pair in WITHOUT_ALTERNATIVES.items() for arm in pair}
    texts = [
        f"{_share_text(shares[finding.arm])} of the time with '{finding.arm}' and {_share_text(shares[other_arm])} "
        f"with '{other_arm}', difference {interval(finding.more_right)}"
        for finding in findings
        if finding.situation == situation and finding.more_right is not None
        for other_arm in [WITHOUT_ALTERNATIVES[finding.arm]]
    ]
    texts += [f"{_share_text(share)} with '{arm}'" for arm, share in shares.items() if arm not in paired_arms]
    return f"{situation}: {label(VARIABLE)} is right for {'; '.join(texts)}."


def _share_text(share: Share) -> str:
    value = ratio(share)
    return "none" if value is None else f"{value:.3f}"


def knowledge_as_data(findings: Sequence[Knowledge]) -> Sequence[Mapping[str, Any]]:
    """Return findings as plain data."""
    return [
        {
            **asdict(finding),
            "more_right": None if finding.more_right is None else estimate_as_data(finding.more_right),
        }
        for finding in findings
    ]
