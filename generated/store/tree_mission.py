"""Behaviour trees of specs/trees/mission.xml.

Made by codra; edits are lost.
"""

from collections.abc import Callable, Mapping

from codra_dsl.runtime.generated_api import (
    Conditions,
    Entry,
    Leaf,
    Subtree,
    Switch,
    create,
    fallback,
    force_success,
    sequence,
)
from codra_dsl.runtime.generated_api import TreeNode as Node


def global_management_tree() -> Node:
    """Return the tree GlobalManagement."""
    return Node(
        "course",
        Switch(Entry("course"), "deliver", "start", "dock"),
        Node(
            "DefaultDeliver",
            Subtree(constants={"delivery_pose": "delivery_delivery", "start_pose": "start"}),
            default_deliver_tree(),
        ),
        Node(
            "ToStart",
            Subtree(constants={"start_pose": "start"}),
            to_start_tree(),
        ),
        Node(
            "Dock",
            Subtree(constants={"charging_pose": "dock"}),
            dock_tree(),
        ),
        Node(
            "PickDeliverStart",
            Subtree(
                remapped={
                    "observation_pose": "observation_pose",
                    "delivery_pose": "delivery_pose",
                    "fetched": "fetched",
                },
                constants={"start_pose": "start"},
            ),
            pick_deliver_start_tree(),
        ),
    )


def pick_deliver_start_tree() -> Node:
    """Return the tree PickDeliverStart."""
    return Node(
        "Sequence",
        sequence(),
        Node(
            "TakeOrder",
            Leaf(
                "TakeOrder",
                outputs={"observation_pose": Entry("observation_pose"), "delivery_pose": Entry("delivery_pose")},
            ),
            conditions=Conditions(on_success=(create("fetched", lambda it: ""),)),
        ),
        Node(
            "serve the order",
            fallback(),
            Node(
                "pick up and deliver",
                sequence(),
                Node(
                    "have the container",
                    fallback(),
                    Node("IsLoaded", Leaf("IsLoaded")),
                    Node(
                        "fetch it",
                        sequence(),
                        Node("to the picking area", Leaf("MoveTo", inputs={"pose": Entry("observation_pose")})),
                        Node("PickUp", Leaf("PickUp", outputs={"result": Entry("fetched")})),
                    ),
                ),
                Node(
                    "PutDown",
                    Subtree(remapped={"delivery_pose": "delivery_pose"}),
                    put_down_tree(),
                ),
                Node("Inform", Leaf("Inform", inputs={"message": "mission completed"})),
            ),
            Node(
                "there is none",
                sequence(),
                Node("CloseOrder", Leaf("CloseOrder", inputs={"outcome": "failed"})),
                Node("Inform", Leaf("Inform", inputs={"message": "mission aborted"})),
                conditions=Conditions(failure_if=lambda it: it["fetched"] != "not_found"),
            ),
            Node(
                "no way to where it was to go",
                sequence(),
                Node("IsLoaded", Leaf("IsLoaded")),
                Node("RedirectOrder", Leaf("RedirectOrder")),
                Node("Inform", Leaf("Inform", inputs={"message": "mission aborted"})),
            ),
            Node(
                "it has failed too often",
                sequence(),
                Node("GiveOrderUp", Leaf("GiveOrderUp", inputs={"tries": "3"})),
                Node("Inform", Leaf("Inform", inputs={"message": "mission aborted"})),
            ),
            Node(
                "LeaveOrder",
                Subtree(),
                leave_order_tree(),
            ),
        ),
        Node(
            "ToStart",
            Subtree(remapped={"start_pose": "start_pose"}),
            to_start_tree(),
        ),
    )


def default_deliver_tree() -> Node:
    """Return the tree DefaultDeliver."""
    return Node(
        "Sequence",
        sequence(),
        Node(
            "PutDown",
            Subtree(remapped={"delivery_pose": "delivery_pose"}),
            put_down_tree(),
        ),
        Node("Inform", Leaf("Inform", inputs={"message": "roll container delivered"})),
        Node(
            "ToStart",
            Subtree(remapped={"start_pose": "start_pose"}),
            to_start_tree(),
        ),
    )


def to_start_tree() -> Node:
    """Return the tree ToStart."""
    return Node(
        "Sequence",
        sequence(),
        Node(
            "LeaveOrder",
            Subtree(),
            leave_order_tree(),
        ),
        Node(
            "be at the start",
            fallback(),
            Node("IsLoaded", Leaf("IsLoaded")),
            Node(
                "ForceSuccess",
                force_success(),
                Node("to the start", Leaf("MoveTo", inputs={"pose": Entry("start_pose")})),
            ),
        ),
        Node("ResumeOrders", Leaf("ResumeOrders")),
    )


def dock_tree() -> Node:
    """Return the tree Dock."""
    return Node(
        "Sequence",
        sequence(),
        Node(
            "LeaveOrder",
            Subtree(),
            leave_order_tree(),
        ),
        Node("to the charging station", Leaf("MoveTo", inputs={"pose": Entry("charging_pose")})),
        Node("Inform", Leaf("Inform", inputs={"message": "charging"})),
    )


def put_down_tree() -> Node:
    """Return the tree PutDown."""
    return Node(
        "Sequence",
        sequence(),
        Node("to the delivery pose", Leaf("MoveTo", inputs={"pose": Entry("delivery_pose")})),
        Node("LowerFork", Leaf("LowerFork")),
        Node("CompleteOrder", Leaf("CompleteOrder", inputs={"at": Entry("delivery_pose")})),
    )


def leave_order_tree() -> Node:
    """Return the tree LeaveOrder."""
    return Node(
        "ForceSuccess",
        force_success(),
        Node(
            "Sequence",
            sequence(),
            Node("SetOrderAside", Leaf("SetOrderAside")),
            Node("Inform", Leaf("Inform", inputs={"message": "mission aborted"})),
        ),
    )


TREES: Mapping[str, Callable[[], Node]] = {
    "GlobalManagement": global_management_tree,
    "PickDeliverStart": pick_deliver_start_tree,
    "DefaultDeliver": default_deliver_tree,
    "ToStart": to_start_tree,
    "Dock": dock_tree,
    "PutDown": put_down_tree,
    "LeaveOrder": leave_order_tree,
}

MAIN: str | None = "GlobalManagement"

ACTIONS: tuple[str, ...] = (
    "CloseOrder",
    "CompleteOrder",
    "GiveOrderUp",
    "Inform",
    "IsLoaded",
    "LowerFork",
    "MoveTo",
    "PickUp",
    "RedirectOrder",
    "ResumeOrders",
    "SetOrderAside",
    "TakeOrder",
)
