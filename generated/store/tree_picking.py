"""Behaviour trees of specs/trees/pick_up.xml.

Made by codra; edits are lost.
"""

from collections.abc import Callable, Mapping

from codra_dsl.runtime.generated_api import (
    Conditions,
    Entry,
    Leaf,
    Subtree,
    create,
    fallback,
    force_failure,
    reactive_sequence,
    retry_until_successful,
    script,
    sequence,
)
from codra_dsl.runtime.generated_api import TreeNode as Node


def pick_up_management_tree() -> Node:
    """Return the tree PickUpManagement."""
    return Node(
        "ReactiveSequence",
        reactive_sequence(),
        Node("IsRequested", Leaf("IsRequested", outputs={"second_observation_pose": Entry("second_observation_pose")})),
        Node(
            "answer the request",
            fallback(),
            Node(
                "fetched",
                sequence(),
                Node(
                    "Fetch",
                    Subtree(remapped={"second_observation_pose": "second_observation_pose", "trouble": "trouble"}),
                    fetch_tree(),
                ),
                Node("Report", Leaf("Report", inputs={"result": "fetched"})),
            ),
            Node(
                "not fetched",
                sequence(),
                Node(
                    "Inform",
                    Leaf("Inform", inputs={"message": Entry("trouble")}),
                    conditions=Conditions(skip_if=lambda it: it["trouble"] == ""),
                ),
                Node("Report", Leaf("Report", inputs={"result": "failed"})),
            ),
        ),
    )


def fetch_tree() -> Node:
    """Return the tree Fetch."""
    return Node(
        "Sequence",
        sequence(),
        Node("Script", script(create("trouble", lambda it: ""))),
        Node(
            "find the roll container",
            fallback(),
            Node(
                "from the first pose",
                Leaf(
                    "DetectContainer",
                    outputs={"container_pose": Entry("container_pose"), "fork_towards": Entry("fork_towards")},
                ),
            ),
            Node(
                "look again",
                sequence(),
                Node(
                    "to the second observation pose",
                    Leaf("MoveTo", inputs={"pose": Entry("second_observation_pose")}),
                ),
                Node(
                    "from there",
                    fallback(),
                    Node(
                        "from the second pose",
                        Leaf(
                            "DetectContainer",
                            outputs={"container_pose": Entry("container_pose"), "fork_towards": Entry("fork_towards")},
                        ),
                    ),
                    Node(
                        "ForceFailure",
                        force_failure(),
                        Node(
                            "Sequence",
                            sequence(),
                            Node("Inform", Leaf("Inform", inputs={"message": "no roll container found"})),
                            Node("Report", Leaf("Report", inputs={"result": "not_found"})),
                        ),
                    ),
                ),
            ),
        ),
        Node("approach it", Leaf("MoveTo", inputs={"pose": Entry("container_pose")})),
        Node(
            "a last check that it was not moved",
            Leaf(
                "DetectContainer",
                outputs={"container_pose": Entry("container_pose"), "fork_towards": Entry("fork_towards")},
            ),
            conditions=Conditions(on_failure=(create("trouble", lambda it: "pose not determined"),)),
        ),
        Node(
            "TurnRound",
            Subtree(remapped={"second_observation_pose": "second_observation_pose", "fork_towards": "fork_towards"}),
            turn_round_tree(),
        ),
        Node(
            "TakeUp",
            Subtree(remapped={"fork_towards": "fork_towards", "trouble": "trouble"}),
            take_up_tree(),
        ),
    )


def turn_round_tree() -> Node:
    """Return the tree TurnRound."""
    return Node(
        "turn the fork towards it",
        fallback(),
        Node("Rotate", Leaf("Rotate", inputs={"angle_deg": "180"})),
        Node(
            "elsewhere",
            sequence(),
            Node("where there is more room", Leaf("MoveTo", inputs={"pose": Entry("second_observation_pose")})),
            Node("before it", Leaf("MoveTo", inputs={"pose": Entry("fork_towards")})),
        ),
    )


def take_up_tree() -> Node:
    """Return the tree TakeUp."""
    return Node(
        "RetryUntilSuccessful",
        retry_until_successful("3"),
        Node(
            "take it up",
            fallback(),
            Node(
                "get under it",
                sequence(),
                Node(
                    "CheckWheels",
                    Leaf("CheckWheels", outputs={"fork_pose": Entry("fork_pose")}),
                    conditions=Conditions(
                        on_success=(create("trouble", lambda it: ""),),
                        on_failure=(create("trouble", lambda it: "pose not determined"),),
                    ),
                ),
                Node("approach it backwards", Leaf("MoveTo", inputs={"pose": Entry("fork_pose")})),
                Node("RaiseFork", Leaf("RaiseFork")),
            ),
            Node(
                "ForceFailure",
                force_failure(),
                Node("out again, to measure anew", Leaf("MoveTo", inputs={"pose": Entry("fork_towards")})),
            ),
        ),
    )


TREES: Mapping[str, Callable[[], Node]] = {
    "PickUpManagement": pick_up_management_tree,
    "Fetch": fetch_tree,
    "TurnRound": turn_round_tree,
    "TakeUp": take_up_tree,
}

MAIN: str | None = "PickUpManagement"

ACTIONS: tuple[str, ...] = (
    "CheckWheels",
    "DetectContainer",
    "Inform",
    "IsRequested",
    "MoveTo",
    "RaiseFork",
    "Report",
    "Rotate",
)
