"""Values in messages whose definitions the compiler did not know."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from codra_dsl.integrations.ros2.messages import value_reader
from codra_dsl.runtime.values.model import TopicModel, ValueType


@pytest.mark.parametrize("content", ["80 %", b"P", None, [80.0]])
def test_a_field_that_is_no_number_has_no_valid_value(content: object) -> None:
    topic = TopicModel(topic="/charge", type="cart_msgs/msg/Charge", field="data", writer="base", factor=100.0)

    assert value_reader(topic, ValueType(kind="float"))(SimpleNamespace(data=content)) is None
