"""The numbers that P1 reports in section 4.1, with two misprints of its Table 2 corrected."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

LOW_RATIO = 0.9
"""Table 2 highlights ratios below this number."""

CONTEXT_DRIVEN, NAIVE = "context-driven (P1)", "naive (P1)"

CONTEXT_DRIVEN_TRIGGERS, NAIVE_TRIGGERS = 1029, 5006
"""The triggers of the PCR-cycler's perception: "a reduction of 79.4%"."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TableRow:
    """An observer in Table 2.

    Attributes:
        agreement_s, disagreement_s: the seconds of each of ten runs.
        printed_total_s: the printed sums of `agreement_s` and of `disagreement_s`.
        printed_ratio: the printed ratio of the totals.
    """

    variable: str
    observer: str
    agreement_s: Sequence[float]
    disagreement_s: Sequence[float]
    printed_total_s: tuple[float, float]
    printed_ratio: float


PRINTED_RUN_4_RATIO = 0.920
"""Misprint 1, in the row of the context-driven observer of `centrifuge_open`: the seconds of run 4 give 0.978."""

PRINTED_RUN_9_AGREEMENT_S = 3898.61
"""Misprint 2, in the same row: with 3589.61 s the row adds up to the printed total, so two digits were swapped."""

TABLE_2 = (
    TableRow(
        variable="centrifuge_open",
        observer=CONTEXT_DRIVEN,
        agreement_s=(2815.11, 1393.59, 3409.49, 1948.05, 6362.58, 3908.05, 1128.22, 5468.07, 3589.61, 2906.36),
        disagreement_s=(4.26, 1.97, 4.41, 43.17, 550.06, 2193.74, 0.86, 2.84, 4.88, 6.67),
        printed_total_s=(32929.13, 2812.80),
        printed_ratio=0.921,
    ),
    TableRow(
        variable="centrifuge_open",
        observer=NAIVE,
        agreement_s=(1362.17, 1360.12, 3378.80, 1492.52, 3199.46, 5422.34, 1126.30, 1873.83, 3585.28, 2313.70),
        disagreement_s=(1457.20, 35.44, 35.10, 498.65, 3713.18, 679.45, 2.79, 3597.07, 9.22, 599.33),
        printed_total_s=(25114.52, 10627.43),
        printed_ratio=0.703,
    ),
    TableRow(
        variable="pcr_cycler_open",
        observer=CONTEXT_DRIVEN,
        agreement_s=(2807.47, 1407.06, 3417.81, 1981.20, 6879.60, 6068.58, 1126.43, 5471.55, 3583.64, 2919.38),
        disagreement_s=(15.26, 0.00, 15.60, 14.00, 34.21, 31.00, 0.00, 6.23, 19.41, 7.16),
        printed_total_s=(35662.81, 142.97),
        printed_ratio=0.996,
    ),
    TableRow(
        variable="pcr_cycler_open",
        observer=NAIVE,
        agreement_s=(2808.33, 1407.06, 3418.28, 1983.57, 6877.13, 6068.36, 1126.43, 5467.76, 3582.15, 2912.21),
        disagreement_s=(14.41, 0.00, 15.13, 11.77, 36.70, 31.26, 0.00, 10.03, 20.90, 14.33),
        printed_total_s=(35651.28, 154.53),
        printed_ratio=0.996,
    ),
)

CONTEXT_DRIVEN_RATIO, NAIVE_RATIO = (
    next(row.printed_ratio for row in TABLE_2 if (row.variable, row.observer) == ("centrifuge_open", observer))
    for observer in (CONTEXT_DRIVEN, NAIVE)
)
"""The ratios of `centrifuge_open`."""
