"""Topics of ROS 2 from which variables get their values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field as dataclass_field
from enum import StrEnum

from codra_dsl.language.diagnostics import Place
from codra_dsl.language.frozen import dataclass


class Qos(StrEnum):
    """The quality of service with which a topic is subscribed."""

    DEFAULT = "default"
    SENSOR_DATA = "sensor_data"
    LATCHED = "latched"


@dataclass(frozen=True, slots=True, kw_only=True)
class Topic:
    """The key `ros` of a variable: a field of the messages of a topic.

    Attributes:
        topic: the name of the topic; relative names are resolved by the node.
        type: the type of the messages, `package/msg/Name`.
        field: the path of the field: names with dots, and indices in brackets.
        factor: the number by which the field is multiplied to get a value in the unit of the variable.
        writer: `main_execution` or the agent as which the values are written; empty if it cannot be determined.
        places: the places of the entries, by key; `ros` is the place of the key itself.
    """

    topic: str
    type: str
    field: str
    factor: float = 1.0
    qos: Qos = Qos.DEFAULT
    writer: str = ""
    places: Mapping[str, Place] = dataclass_field(default_factory=dict, compare=False, hash=False)
