"""The edges that contribute to the relative pose of two nodes."""

from __future__ import annotations

import pytest

from codra_dsl.language.check.index.graph_schema import DeclaredGraph
from tests.language.check.specs import check_sound_text

SPEC = """\
codra: 1
name: yard
knowledge:
  types:
    crate: {source: people}
  nodes: {map: map, world: world, robot: robot, eye: eye, arm: arm, tray: tray, cart: cart,
    load: load, one: cup, two: cup}
  edges:
    world_pose: {label: RT, from: map, to: world, source: people}
    robot_pose: {label: RT, from: world, to: robot, source: people}
    eye_pose: {label: RT, from: robot, to: eye, source: people}
    arm_pose: {label: RT, from: robot, to: arm, source: people}
    tray_pose: {label: RT, from: arm, to: tray, source: people}
    cart_pose: {label: RT, from: world, to: cart, source: people}
    load_pose: {label: RT, from: [tray, cart], to: load, source: people}
    crate_pose: {label: RT, from: cart, to: crate, source: people}
    cup_pose: {label: RT, from: crate, to: cup, source: people}
agents: {people: {}}
"""


@pytest.mark.parametrize(
    ("one", "other", "edges"),
    [
        ("robot", "robot", ""),
        ("world", "map", "world"),
        ("eye", "robot", "eye"),
        ("eye", "tray", "eye arm tray"),
        ("eye", "cart", "robot eye cart"),
        ("tray", "load", "robot arm tray cart load"),
        ("cart", "load", "robot arm tray cart load"),
        ("robot", "load", "robot arm tray cart load"),
        ("one", "cart", "crate cup"),
        ("one", "two", "crate cup"),
    ],
)
def test_edges_that_move_both_nodes_do_not_contribute_to_their_relative_pose(one: str, other: str, edges: str) -> None:
    """A load is on the tray or on the cart; two cups are in one crate or in two crates, which are in the cart."""
    world = DeclaredGraph(check_sound_text(SPEC).spec)
    assert world.pose_edges_between(one, other) == tuple(f"{edge}_pose" for edge in edges.split())
    assert world.pose_edges_between(other, one) == world.pose_edges_between(one, other)
