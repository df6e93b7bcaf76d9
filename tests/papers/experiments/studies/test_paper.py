"""The arithmetic of P1's Table 2: the corrections are right, and no other number is wrong."""

from __future__ import annotations

import pytest

from codra_papers.experiments.studies.robustness.paper import (
    CONTEXT_DRIVEN_TRIGGERS,
    NAIVE_TRIGGERS,
    PRINTED_RUN_4_RATIO,
    PRINTED_RUN_9_AGREEMENT_S,
    TABLE_2,
    TableRow,
)

CENTRIFUGE_CONTEXT_DRIVEN, CENTRIFUGE_NAIVE = TABLE_2[:2]


def of_run(row: TableRow, number: int) -> tuple[float, float]:
    return row.agreement_s[number - 1], row.disagreement_s[number - 1]


def test_the_ratio_of_run_4_differs_from_the_printed_one() -> None:
    right_s, wrong_s = of_run(CENTRIFUGE_CONTEXT_DRIVEN, 4)

    assert round(right_s / (right_s + wrong_s), 3) == 0.978 != PRINTED_RUN_4_RATIO


def test_the_row_adds_up_to_its_total_with_the_corrected_agreement_of_run_9_and_not_with_the_printed_one() -> None:
    agreement_s, total_s = CENTRIFUGE_CONTEXT_DRIVEN.agreement_s, CENTRIFUGE_CONTEXT_DRIVEN.printed_total_s[0]
    others_s = sum(agreement_s) - agreement_s[8]

    assert round(others_s + 3589.61, 2) == total_s
    assert round(others_s + PRINTED_RUN_9_AGREEMENT_S, 2) != total_s


def test_with_the_corrected_agreement_both_observers_cover_the_same_seconds_of_run_9() -> None:
    both_s = [sum(of_run(row, 9)) for row in (CENTRIFUGE_CONTEXT_DRIVEN, CENTRIFUGE_NAIVE)]

    assert both_s[0] == pytest.approx(both_s[1], abs=0.02)


@pytest.mark.parametrize("row", TABLE_2, ids=lambda row: f"{row.observer} {row.variable}")
def test_every_row_adds_up_to_its_total_and_ratio_as_printed(row: TableRow) -> None:
    right_s, wrong_s = row.printed_total_s

    assert sum(row.agreement_s) == pytest.approx(right_s, abs=0.15)
    assert sum(row.disagreement_s) == pytest.approx(wrong_s, abs=0.15)
    assert round(right_s / (right_s + wrong_s), 3) == row.printed_ratio
    assert len(row.agreement_s) == len(row.disagreement_s) == 10


def test_the_triggers_give_the_reported_reduction() -> None:
    assert round(100 * (1 - CONTEXT_DRIVEN_TRIGGERS / NAIVE_TRIGGERS), 1) == 79.4
