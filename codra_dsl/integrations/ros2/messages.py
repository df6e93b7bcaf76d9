"""Values, time stamps and poses in ROS 2 messages. Messages are read by their fields, so no ROS is needed."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

from codra_dsl.runtime import Value
from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.values.model import NotOfTypeError, TopicModel, ValueType, unbox

_STEP = re.compile(r"(\w+)(?:\[(\d+)\])?")


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseTopic:
    """A topic whose messages are poses of a node of the knowledge graph.

    The messages are `PoseStamped` or `Odometry`, whose pose is that of `target` relative to `origin`, or
    `TransformStamped` or `TFMessage`, of which those transforms are used that lead from `frame` to `child_frame`.

    Attributes:
        topic: the name of the topic, such as `/odom` or `/tf`.
        type: the type of the messages, `package/msg/Name`.
        agent: the agent that writes the poses.
        edge: the type of the edge with the poses.
        origin: the node to which the poses are relative.
        target: the node that has the poses.
        frame: the frame in the header of the messages that are used; empty for messages with any frame.
        child_frame: the child frame of the messages that are used; empty for messages with any child frame.
        qos: the quality of service of the subscription: `default`, `sensor_data` or `latched`.
    """

    topic: str
    type: str
    agent: str
    edge: str
    origin: str
    target: str
    frame: str = ""
    child_frame: str = ""
    qos: str = "default"


class StampedPose(NamedTuple):
    """A pose in a message; `child_frame` is empty if the message does not name the frame that has the pose."""

    stamp_s: float | None
    frame: str
    child_frame: str
    pose: Pose


def value_reader(topic: TopicModel, value_type: ValueType) -> Callable[[Any], Value | None]:
    """Return a function that returns the value of a variable in a message.

    It returns None if the message has no valid value: NaN, an item past the end of a list, or a value that the type of
    the variable does not allow. The compiler cannot check fields of types whose definition it does not know.
    """
    steps = [match.groups() for match in map(_STEP.fullmatch, topic.field.split(".")) if match is not None]
    factor = int(topic.factor) if value_type.kind == "int" else topic.factor
    is_scaled = topic.factor != 1.0 and value_type.kind in ("int", "float")

    def read(message: Any) -> Value | None:
        part = message
        try:
            for name, index in steps:
                part = getattr(part, name)
                part = part if index is None else part[int(index)]
            return value_type.convert(unbox(part) * factor if is_scaled else part)  # type: ignore[operator]
        except (IndexError, TypeError, NotOfTypeError):
            return None

    return read


def stamp_s(message: Any) -> float | None:
    """Return the time stamp in the header of a message, or None if it has no header or its stamp is zero."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    if stamp is None or (stamp.sec, stamp.nanosec) == (0, 0):
        return None
    return seconds(stamp)


def seconds(time: Any) -> float:
    """Return the seconds of a time of ROS."""
    return float(time.sec) + float(time.nanosec) * 1e-9


def poses_in(message: Any) -> Iterator[StampedPose]:
    """Yield the poses in a PoseStamped, an Odometry, a TransformStamped or a TFMessage; invalid ones are left out.

    Raises:
        TypeError: if the message has no pose.
    """
    if hasattr(message, "transforms"):
        for transform in message.transforms:
            yield from poses_in(transform)
        return
    content = getattr(message, "transform", None) or getattr(message, "pose", None)
    if content is None:
        raise TypeError(f"messages of the type {type(message).__name__} have no pose")
    content = getattr(content, "pose", content)  # a pose with covariance
    position = content.translation if hasattr(content, "translation") else content.position
    rotation = content.rotation if hasattr(content, "rotation") else content.orientation
    try:
        pose = Pose.of(
            (position.x, position.y, position.z),
            (rotation.w, rotation.x, rotation.y, rotation.z),
        )
    except ValueError:
        return
    yield StampedPose(stamp_s(message), message.header.frame_id, getattr(message, "child_frame_id", ""), pose)
