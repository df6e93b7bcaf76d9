"""A spec with twelve unrelated mistakes. The expected findings were written before the compiler first read it."""

from __future__ import annotations

from pathlib import Path

from codra_dsl.compiler import plan_paths

WORKSHOP = Path(__file__).parents[1] / "cases" / "twelve" / "workshop.yaml"

EXPECTED = [
    (7, "bol", "bool"),
    (8, "valid_fro", "valid_for"),
    (9, "vise_clean", "source"),
    (25, "robot_is_localised", "robot_is_localized"),
    (27, "90", "90 m"),
    (29, "workshop.perception.find_vise", "workshop.perception:find_vise"),
    (30, "camera", "read"),
    (31, "timeout", "5 s"),
    (45, "camra", "camera"),
    (51, "dril", "drill"),
    (54, "edges", "edge"),
    (67, "vise_loded", "vise_loaded"),
]


def test_twelve_unrelated_mistakes_give_twelve_findings_in_file_order_with_their_help() -> None:
    planned = plan_paths([WORKSHOP], WORKSHOP.parent)

    assert [finding.place.span.line for finding in planned.diagnostics] == [line for line, _, _ in EXPECTED]
    for finding, (_, offender, help_part) in zip(planned.diagnostics, EXPECTED, strict=True):
        assert offender in finding.message
        assert help_part in finding.help
