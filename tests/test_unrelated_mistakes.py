"""A spec with twelve unrelated mistakes. What is expected was written down before the compiler first saw it."""

from __future__ import annotations

from pathlib import Path

from codra_dsl.compiler import plan_paths

WORKSHOP = Path(__file__).parent / "cases" / "twelve" / "workshop.yaml"

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


def test_twelve_unrelated_mistakes_give_twelve_findings_in_file_order_with_the_way_out_of_each() -> None:
    planned = plan_paths([WORKSHOP], WORKSHOP.parent)

    assert [found.place.span.line for found in planned.diagnostics] == [line for line, _, _ in EXPECTED]
    for found, (_, offender, way_out) in zip(planned.diagnostics, EXPECTED, strict=True):
        assert offender in found.message
        assert way_out in found.help
