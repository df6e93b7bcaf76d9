"""A node of ROS 2 that feeds a context manager from topics, publishes its variables, and answers services.

Only messages and services that every installation of ROS 2 has are used: `rcl_interfaces`, `diagnostic_msgs` and
`rosgraph_msgs`. In a `Parameter`, an unknown variable has the type `NOT_SET`, so it cannot be mistaken for a value.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib import import_module
from types import TracebackType
from typing import Any, Self

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import Parameter, ParameterDescriptor, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, GetParameters
from rclpy.executors import ExternalShutdownException, ShutdownException, SingleThreadedExecutor, TimeoutException
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from rosgraph_msgs.msg import Clock as ClockMessage

from codra_dsl.integrations.ros2.messages import PoseTopic, poses_in, seconds, stamp_s, value_reader
from codra_dsl.runtime import Clock, ContextManager, Reading, SimClock, UnknownNameError, Value, WallClock
from codra_dsl.runtime.values.model import TopicModel, VariableModel

__all__ = ["Bridge", "clock_of"]

MAX_LEAD_S = 0.5
"""In real time, messages with a stamp that lies further in the future are dropped: their clock is not that of codra."""

_STAMP_TOLERANCE_S = 1e-6
_SPIN_S = 0.1
_DIAGNOSTICS_PERIOD_S = 1.0
_LOG_PERIOD_S = 5.0
_CLOCK_DEPTH = 1000
_LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_PROFILES: Mapping[str, Any] = {
    "default": QoSProfile(depth=10),
    "sensor_data": qos_profile_sensor_data,
    "latched": _LATCHED,
}


def clock_of(node: Any, *, timeout_s: float = math.inf) -> Clock:
    """Return the clock for a context manager whose node is `node`.

    This is a `WallClock`; if the parameter `use_sim_time` of the node is true, it is a `SimClock` at the time of the
    next message on `/clock`, for which this function waits.

    Raises:
        TimeoutError: if no message arrives on `/clock` within `timeout_s`.
    """
    if not node.get_parameter("use_sim_time").value:
        return WallClock()
    messages: list[Any] = []
    subscription = node.create_subscription(ClockMessage, "/clock", messages.append, qos_profile_sensor_data)
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    wall_clock = WallClock(0.0)
    try:
        while not messages:
            if wall_clock.now_s() >= timeout_s:
                raise TimeoutError(f"use_sim_time is true, but there was no message on /clock within {timeout_s:g} s")
            executor.spin_once(timeout_sec=_SPIN_S)
    finally:
        wall_clock.close()
        executor.remove_node(node)
        executor.shutdown()
        node.destroy_subscription(subscription)
    return SimClock(seconds(messages[-1].clock))


class Bridge:
    """Connects a context manager with ROS 2, from its creation until `close`.

    - Messages of the topics that the spec declares with `ros` become values, and their stamps the time of evidence. A
      message without a valid value (NaN, outside the range) makes its variable unknown.
    - Messages of `poses` become poses of the knowledge graph.
    - Each variable is published on the latched topic `~/context/NAME`, and all of them on `/diagnostics`.
    - `~/get`, `~/decide`, `~/preview` and `~/why` are services.

    With a `WallClock`, spin the node in any thread, with any executor. With a `SimClock`, call `spin` in the thread
    that created the clock: it advances the clock with the messages on `/clock`.
    """

    def __init__(
        self, codra: ContextManager[Any, Any], node: Any, clock: Clock, *, poses: Sequence[PoseTopic] = ()
    ) -> None:
        """Subscribe to topics, and offer topics and services.

        Args:
            codra: the context manager, which was started with `clock`.
            node: the node of `rclpy`.
            clock: the clock, from `clock_of(node)`.
            poses: the topics with poses.

        Raises:
            ModuleNotFoundError: if the package of a message type is not installed.
            AttributeError: if a package of messages lacks a type.
            UnknownNameError: if the spec lacks the agent of a pose.
        """
        self._codra, self._node, self._clock = codra, node, clock
        self._is_simulated = isinstance(clock, SimClock)
        self._latest_clock_s = -math.inf
        self._entities: list[tuple[Callable[[Any], object], Any]] = []
        # Comparisons with poses are variables as well; their names are no names of topics.
        self._models = {model.name: model for model in codra.model.variables if model.name.isidentifier()}
        self._subscribe_to_variables()
        self._agents = {name: codra.agent(name) for name in sorted({topic.agent for topic in poses})}
        for topic in poses:
            self._subscribe(topic.topic, topic.type, topic.qos, self._pose_writer(topic))
        if self._is_simulated:
            profile = QoSProfile(depth=_CLOCK_DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)
            self._own(
                node.destroy_subscription, node.create_subscription(ClockMessage, "/clock", self._note_clock, profile)
            )
        self._publishers = {name: self._publisher(f"~/context/{name}", Parameter, _LATCHED) for name in self._models}
        self._diagnostics = self._publisher("/diagnostics", DiagnosticArray, QoSProfile(depth=10))
        self._own(node.destroy_timer, node.create_timer(_DIAGNOSTICS_PERIOD_S, self._publish_diagnostics))
        for name, kind, answer in (
            ("get", GetParameters, self._get),
            ("decide", GetParameters, self._decide),
            ("preview", DescribeParameters, self._preview),
            ("why", DescribeParameters, self._why),
        ):
            self._own(node.destroy_service, node.create_service(kind, f"~/{name}", answer))
        self._subscription = codra.subscribe(self._models, self._publish)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End all subscriptions, topics and services. The node and the context manager stay open."""
        self._subscription.unsubscribe()
        for agent in self._agents.values():
            agent.close()
        while self._entities:
            destroy, entity = self._entities.pop()
            destroy(entity)

    def spin(self, until: Callable[[], bool] = lambda: False) -> None:
        """Run the callbacks of the node until `until()` is true or ROS is shut down.

        With a `SimClock`, the clock advances only when all messages that have arrived are written. So what happens does
        not depend on the speed of the machine or of the simulation.
        """
        executor = SingleThreadedExecutor(context=self._node.context)
        executor.add_node(self._node)
        try:
            while not until() and self._node.context.ok():
                timeout_s = _SPIN_S
                while self._run_callback(executor, timeout_s):
                    timeout_s = 0.0
                    if not self._is_simulated and until():
                        return
                if self._latest_clock_s > self._clock.now_s():
                    self._clock.sleep(self._latest_clock_s - self._clock.now_s())
        finally:
            executor.remove_node(self._node)
            executor.shutdown()

    def _run_callback(self, executor: Any, timeout_s: float) -> bool:
        """Run one callback that is ready within a time; return whether there was one."""
        try:
            handler, _, _ = executor.wait_for_ready_callbacks(timeout_sec=timeout_s)
        except (TimeoutException, ShutdownException, ExternalShutdownException):
            return False
        handler()
        handler.result()  # raises the exception of the callback
        return True

    # Topics to variables and poses

    def _subscribe_to_variables(self) -> None:
        writers: dict[tuple[str, str, str], list[Callable[[Any], None]]] = {}
        for model in self._models.values():
            if model.ros is not None:
                key = model.ros.topic, model.ros.type, model.ros.qos
                writers.setdefault(key, []).append(self._variable_writer(model, model.ros))
        for (topic, type_name, qos), writers_of_topic in writers.items():
            self._subscribe(topic, type_name, qos, _calling(writers_of_topic))

    def _variable_writer(self, model: VariableModel, topic: TopicModel) -> Callable[[Any], None]:
        read = value_reader(topic, model.type)

        def write(message: Any) -> None:
            value = read(message)
            if value is None:
                text = f"{model.name}: a message on {topic.topic} has no valid value in its field {topic.field}"
                self._node.get_logger().warning(text, throttle_duration_sec=_LOG_PERIOD_S)
            self._at_stamp(
                stamp_s(message),
                topic.topic,
                lambda evidence_s: self._codra.commands.write(model.name, value, topic.writer, evidence_s),
            )

        return write

    def _pose_writer(self, topic: PoseTopic) -> Callable[[Any], None]:
        def write(message: Any) -> None:
            for stamped in poses_in(message):
                if topic.frame in ("", stamped.frame) and topic.child_frame in ("", stamped.child_frame):
                    self._place(topic, stamped.pose, stamped.stamp_s)

        return write

    def _place(self, topic: PoseTopic, pose: Any, pose_stamp_s: float | None) -> None:
        graph: Any = self._agents[topic.agent].graph
        self._at_stamp(
            pose_stamp_s,
            topic.topic,
            lambda evidence_s: graph.place(topic.origin, topic.edge, topic.target, pose, stamp_s=evidence_s),
        )

    def _at_stamp(self, message_s: float | None, topic: str, write: Callable[[float], None]) -> None:
        """Write with the stamp of a message as the time of evidence, or with the present time if it has no stamp.

        In simulated time, a message whose stamp `/clock` has not reached is written when `/clock` reaches it.
        """
        now_s = self._clock.now_s()
        evidence_s = now_s if message_s is None else message_s
        if evidence_s <= now_s + (_STAMP_TOLERANCE_S if self._is_simulated else MAX_LEAD_S):
            write(min(evidence_s, now_s))
        elif self._is_simulated:
            self._clock.call_at(evidence_s, lambda: write(evidence_s))
        else:
            text = f"{topic}: a message is dropped, because its stamp lies {evidence_s - now_s:.3g} s in the future"
            self._node.get_logger().warning(text, throttle_duration_sec=_LOG_PERIOD_S)

    def _note_clock(self, message: Any) -> None:
        now_s = seconds(message.clock)
        if now_s < self._clock.now_s():
            text = "/clock has jumped back: messages are not used until it reaches its former time; start codra again"
            self._node.get_logger().error(text, throttle_duration_sec=_LOG_PERIOD_S)
        self._latest_clock_s = max(self._latest_clock_s, now_s)

    # Variables to topics

    def _publish(self, reading: Reading[Any]) -> None:
        self._publishers[reading.name].publish(Parameter(name=reading.name, value=_parameter_value(reading.content)))

    def _publish_diagnostics(self) -> None:
        readings = self._codra.readings(self._models)
        message = DiagnosticArray(status=[self._status(reading) for reading in readings.values()])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._diagnostics.publish(message)

    def _status(self, reading: Reading[Any]) -> Any:
        unit = self._models[reading.name].type.unit
        value_text = f"{reading.content} {unit}" if unit else str(reading.content)
        reason_text = f"{reading.reason}: {reading.detail}" if reading.detail else str(reading.reason)
        details = {"source": reading.source}
        if math.isfinite(reading.evidence_s):
            details["evidence_s"] = f"{reading.evidence_s:.3f}"
        return DiagnosticStatus(
            level=DiagnosticStatus.OK if reading.known else DiagnosticStatus.STALE,
            name=f"{self._codra.model.name}: {reading.name}",
            hardware_id=self._node.get_fully_qualified_name(),
            message=value_text if reading.known else f"unknown ({reason_text})",
            values=[KeyValue(key=key, value=value) for key, value in details.items()],
        )

    # Services

    def _get(self, request: Any, response: Any) -> Any:
        return self._values(request, response, lambda name: self._codra.get(name).content)

    def _decide(self, request: Any, response: Any) -> Any:
        return self._values(request, response, lambda name: self._codra.decide(name, otherwise=lambda: None))

    def _values(self, request: Any, response: Any, find: Callable[[str], Value | None]) -> Any:
        """Answer with one value for each name, or with no values if the spec lacks a name, as parameters of ROS do."""
        try:
            response.values = [_parameter_value(find(name)) for name in request.names]
        except UnknownNameError as error:
            self._node.get_logger().warning(str(error))
        return response

    def _preview(self, request: Any, response: Any) -> Any:
        return self._descriptions(request, response, lambda name: str(self._codra.preview(name)))

    def _why(self, request: Any, response: Any) -> Any:
        return self._descriptions(request, response, lambda name: str(self._codra.why(name)))

    def _descriptions(self, request: Any, response: Any, describe: Callable[[str], str]) -> Any:
        for name in request.names:
            try:
                text = describe(name)
            except UnknownNameError as error:
                text = f"error: {error}"
            response.descriptors.append(ParameterDescriptor(name=name, description=text, read_only=True))
        return response

    # Entities of the node

    def _subscribe(self, topic: str, type_name: str, qos: str, callback: Callable[[Any], None]) -> None:
        subscription = self._node.create_subscription(_message_class(type_name), topic, callback, _PROFILES[qos])
        self._own(self._node.destroy_subscription, subscription)

    def _publisher(self, topic: str, kind: Any, profile: Any) -> Any:
        return self._own(self._node.destroy_publisher, self._node.create_publisher(kind, topic, profile))

    def _own(self, destroy: Callable[[Any], object], entity: Any) -> Any:
        self._entities.append((destroy, entity))
        return entity


def _calling(callbacks: Iterable[Callable[[Any], None]]) -> Callable[[Any], None]:
    def call(message: Any) -> None:
        for callback in callbacks:
            callback(message)

    return call


def _message_class(type_name: str) -> Any:
    package, _, name = type_name.split("/")
    return getattr(import_module(f"{package}.msg"), name)


def _parameter_value(content: Value | None) -> Any:
    """Return a value as a parameter of ROS, whose type says that it is unknown if it is None."""
    match content:
        case None:
            return ParameterValue(type=ParameterType.PARAMETER_NOT_SET)
        case bool():
            return ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=content)
        case int():
            return ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=content)
        case float():
            return ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=content)
    return ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=content)
