"""The bridge with real ROS 2: other programs publish, and other participants listen and call services.

The wheels of ROS 2 lack `tf2_msgs`, `ros2 bag` and `ros2` itself. So transforms come from topics of TransformStamped,
TFMessage is read from objects of rosbags, and a program of ours plays the bag.
"""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped, TransformStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import Parameter, ParameterType
from rcl_interfaces.srv import DescribeParameters, GetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Bool, String

from codra_dsl.integrations.inspection import compile_and_load
from codra_dsl.integrations.ros2 import Bridge, PoseTopic, clock_of
from codra_dsl.integrations.ros2.messages import poses_in
from codra_dsl.runtime import Clock, Kind, Reason, WallClock
from tests.integrations.ros2.publisher import PERIOD_NS, TOPICS

ROOT = Path(__file__).parents[3]
BATTERY = "topic: /battery_state, type: sensor_msgs/msg/BatteryState"
CART = f"""\
codra: 1
name: cart
agents: {{base: {{}}}}
context:
  charge:
    type: float
    unit: percent
    range: [0, 100]
    source: base
    valid_for: 1 s
    ros: {{{BATTERY}, field: percentage, scale: 100, unit: percent}}
  supply: {{type: int, source: base, ros: {{{BATTERY}, field: power_supply_status}}}}
  cell: {{type: float, unit: V, source: base, ros: {{{BATTERY}, field: "cell_voltage[1]", unit: V}}}}
  place:
    type: enum
    values: [dock, hall]
    source: main_execution
    ros: {{topic: /place, type: std_msgs/msg/String, field: data, qos: latched}}
  lifted: {{type: bool, source: base, ros: {{topic: /lifted, type: std_msgs/msg/Bool, field: data}}}}
  ready: {{type: bool, derived: charge > 20 percent and supply == 1}}
skills:
  drive: {{preview: [charge > 20 percent, supply == 1, cell, place, lifted == false, ready]}}
"""
FRAMES = """\
codra: 1
name: frames
agents: {localization: {}, odometry: {}, calibration: {}, hand: {}}
context:
  near: {type: bool, derived: "distance(world, arm) < 5 m"}
knowledge:
  nodes: {world: world, track: track, base: base, mast: mast, arm: arm}
  edges:
    track_pose: {label: RT, from: world, to: track, source: localization, valid_for: forever}
    base_pose: {label: RT, from: track, to: base, source: odometry, valid_for: forever}
    mast_pose: {label: RT, from: base, to: mast, source: calibration, valid_for: forever}
    arm_pose: {label: RT, from: mast, to: arm, source: hand, valid_for: forever}
skills:
  reach: {preview: [near]}
"""
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Peer:
    """Another participant, with a context, a node and an executor of its own."""

    def __init__(self) -> None:
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        self.node = rclpy.create_node("peer", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)

    def until(self, is_over: Callable[[], bool]) -> Callable[[], bool]:
        """Return a condition for `Bridge.spin` that also runs the callbacks of this participant."""

        def check() -> bool:
            self._executor.spin_once(timeout_sec=0)
            return is_over()

        return check

    def messages(self, kind: Any, topic: str, profile: Any = 10) -> list[Any]:
        """Subscribe to a topic, and return the list to which its messages will be appended."""
        messages: list[Any] = []
        self.node.create_subscription(kind, topic, messages.append, profile)
        return messages

    def publish(self, bridge: Bridge, is_over: Callable[[], bool], *topics: tuple[Any, str, Any]) -> None:
        """Publish messages again and again until a condition holds: the first ones come before the subscriptions."""
        publishers = [
            (self.node.create_publisher(type(message), topic, profile), message) for message, topic, profile in topics
        ]

        def publish() -> None:
            for publisher, message in publishers:
                if hasattr(message, "header"):
                    message.header.stamp = self.node.get_clock().now().to_msg()
                publisher.publish(message)

        timer = self.node.create_timer(0.02, publish)
        bridge.spin(self.until(is_over))
        self.node.destroy_timer(timer)
        for publisher, _ in publishers:
            self.node.destroy_publisher(publisher)

    def call(self, bridge: Bridge, kind: Any, service: str, *names: str) -> Any:
        client = self.node.create_client(kind, service)
        bridge.spin(self.until(client.service_is_ready))
        answer = client.call_async(kind.Request(names=list(names)))
        bridge.spin(self.until(answer.done))
        self.node.destroy_client(client)
        return answer.result()

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)


@pytest.fixture
def peer() -> Iterator[Peer]:
    peer = Peer()
    yield peer
    peer.close()


@pytest.fixture
def node() -> Iterator[Any]:
    node = rclpy.create_node("codra")
    yield node
    node.destroy_node()


def started(text: str, folder: Path, clock: Clock) -> Any:
    """Return the context manager of a spec."""
    (folder / "spec.yaml").write_text(text)
    return compile_and_load(folder / "spec.yaml", folder / "made").start(clock=clock, resources={})


@pytest.fixture
def cart(tmp_path: Path, node: Any) -> Iterator[Any]:
    """A cart with its bridge, in real time."""
    clock = clock_of(node)
    assert isinstance(clock, WallClock)
    with clock, started(CART, tmp_path, clock) as codra, Bridge(codra, node, clock) as bridge:
        yield SimpleNamespace(codra=codra, bridge=bridge, clock=clock)


def battery(fraction: float, status: int = 1, cells: tuple[float, ...] = (3.5, 3.75)) -> Any:
    return BatteryState(percentage=fraction, power_supply_status=status, cell_voltage=list(cells))


# Topics to variables


def test_ten_topics_at_50_hz_arrive_with_their_stamps_as_evidence(tmp_path: Path, node: Any) -> None:
    variables = "\n".join(
        f"  value_{number}: {{type: float, source: base, ros: {{topic: /sensor_{number}, "
        f"type: geometry_msgs/msg/PointStamped, field: point.x, qos: {'sensor_data' if number % 2 else 'default'}}}}}"
        for number in range(TOPICS)
    )
    names = [f"value_{number}" for number in range(TOPICS)]
    skills = f"skills: {{go: {{preview: [{', '.join(names)}]}}}}"
    spec = f"codra: 1\nname: sensors\nagents: {{base: {{}}}}\ncontext:\n{variables}\n{skills}\n"
    clock = clock_of(node)
    command = [sys.executable, "-m", "tests.integrations.ros2.publisher", "topics"]
    with (
        subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as robot,
        clock,  # type: ignore[attr-defined]
        started(spec, tmp_path, clock) as codra,
        Bridge(codra, node, clock) as bridge,
    ):
        bridge.spin(lambda: all((codra.get(name).content or 0) >= 100 for name in names))
        assert robot.stdin is not None
        assert robot.stdout is not None
        start_ns = int(robot.stdout.readline())
        robot.stdin.close()
    events = [event for event in codra.record.of(Kind.VARIABLE) if event.what == "identified"]

    assert {event.name for event in events} == set(names)
    for event in events:
        value, evidence_s = event.details["value"], event.details["evidence_s"]
        assert evidence_s == pytest.approx((start_ns + value * PERIOD_NS) / 1e9, abs=1e-6)
        assert evidence_s <= event.instant_s


def test_fields_are_scaled_converted_and_taken_from_lists(cart: Any, peer: Peer) -> None:
    names = ("charge", "supply", "cell", "place", "lifted", "ready")

    peer.publish(
        cart.bridge,
        lambda: all(cart.codra.get(name).known for name in names),
        (battery(0.5), "/battery_state", 10),
        (String(data="hall"), "/place", LATCHED),
        (Bool(data=False), "/lifted", 10),
    )

    values = {name: cart.codra.get(name).value for name in names}
    assert values == {"charge": 50.0, "supply": 1, "cell": 3.75, "place": "hall", "lifted": False, "ready": True}
    assert {cart.codra.get(name).source for name in ("charge", "place")} == {"base", "main_execution"}


def test_a_publisher_that_stops_makes_its_variable_unknown_when_its_evidence_is_too_old(cart: Any, peer: Peer) -> None:
    peer.publish(cart.bridge, lambda: cart.codra.get("charge").known, (battery(0.5), "/battery_state", 10))
    last = cart.codra.get("charge").evidence_s

    cart.bridge.spin(lambda: not cart.codra.get("charge").known)

    reading = cart.codra.get("charge")
    assert (reading.reason, reading.identified_s) == (Reason.STALE, pytest.approx(last + 1.0, abs=1e-6))
    assert cart.codra.get("ready").content is None
    assert cart.codra.get("supply").value == 1


@pytest.mark.parametrize("message", [battery(math.nan), battery(1.5)], ids=["NaN", "outside the range"])
def test_a_message_without_a_valid_value_makes_its_variable_unknown(cart: Any, peer: Peer, message: Any) -> None:
    peer.publish(cart.bridge, lambda: cart.codra.get("charge").known, (battery(0.5), "/battery_state", 10))
    peer.publish(
        cart.bridge, lambda: cart.codra.get("charge").reason is Reason.REJECTED, (message, "/battery_state", 10)
    )

    assert not cart.codra.get("charge").known
    assert cart.codra.get("supply").value == 1


def test_a_message_from_the_future_is_dropped_and_one_without_stamp_is_evidence_from_now(
    cart: Any, peer: Peer, capfd: pytest.CaptureFixture[str]
) -> None:
    begin_s = cart.clock.now_s()
    future, unstamped = battery(0.5, status=4), battery(0.5, status=1)
    future.header.stamp.sec = 2**31 - 1
    publisher = peer.node.create_publisher(BatteryState, "/battery_state", 10)
    timer = peer.node.create_timer(0.02, lambda: publisher.publish(future))

    cart.bridge.spin(peer.until(lambda: "/battery_state: a message is dropped" in capfd.readouterr().err))
    peer.node.destroy_timer(timer)
    peer.node.create_timer(0.02, lambda: publisher.publish(unstamped))
    cart.bridge.spin(peer.until(lambda: cart.codra.get("supply").known))

    values = {event.details["value"] for event in cart.codra.record.of(Kind.VARIABLE) if event.name == "supply"}
    assert values == {1}
    assert begin_s <= cart.codra.get("supply").evidence_s <= cart.clock.now_s()


# Variables to topics and services


def test_late_joiners_get_the_latched_values_and_unknown_ones_have_no_type(cart: Any, peer: Peer) -> None:
    peer.publish(
        cart.bridge,
        lambda: cart.codra.get("place").known and cart.codra.get("supply").known,
        (String(data="dock"), "/place", LATCHED),
        (battery(0.5), "/battery_state", 10),
    )
    late = Peer()
    received = {
        name: late.messages(Parameter, f"/codra/context/{name}", LATCHED) for name in ("place", "supply", "lifted")
    }

    cart.bridge.spin(late.until(lambda: all(received.values())))
    late.close()

    values = {name: messages[-1].value for name, messages in received.items()}
    assert (values["place"].type, values["place"].string_value) == (ParameterType.PARAMETER_STRING, "dock")
    assert (values["supply"].type, values["supply"].integer_value) == (ParameterType.PARAMETER_INTEGER, 1)
    assert values["lifted"].type == ParameterType.PARAMETER_NOT_SET


def test_diagnostics_state_each_value_or_why_it_is_unknown(cart: Any, peer: Peer) -> None:
    messages = peer.messages(DiagnosticArray, "/diagnostics")

    peer.publish(
        cart.bridge,
        lambda: any(status.message == "dock" for message in messages for status in message.status),
        (String(data="dock"), "/place", LATCHED),
    )

    statuses = {status.name: (status.level, status.message) for status in messages[-1].status}
    assert statuses["cart: place"] == (DiagnosticStatus.OK, "dock")
    assert statuses["cart: lifted"] == (DiagnosticStatus.STALE, "unknown (never_observed)")


def test_services_get_decide_preview_and_explain(cart: Any, peer: Peer) -> None:
    peer.publish(cart.bridge, lambda: cart.codra.get("place").known, (String(data="dock"), "/place", LATCHED))

    got = peer.call(cart.bridge, GetParameters, "/codra/get", "place", "lifted").values
    decided = peer.call(cart.bridge, GetParameters, "/codra/decide", "place").values
    misspelt = peer.call(cart.bridge, GetParameters, "/codra/get", "place", "plac").values
    previewed = peer.call(cart.bridge, DescribeParameters, "/codra/preview", "drive").descriptors
    explained = peer.call(cart.bridge, DescribeParameters, "/codra/why", "place", "plac").descriptors

    assert [value.type for value in got] == [ParameterType.PARAMETER_STRING, ParameterType.PARAMETER_NOT_SET]
    assert [value.string_value for value in decided] == ["dock"]
    assert misspelt == []
    assert [event.name for event in cart.codra.record.of(Kind.DECISION)] == ["place"]
    assert previewed[0].description.startswith("unknown: charge")
    assert explained[0].description.startswith("place is 'dock' at ")
    assert explained[1].description.startswith("error: ")
    assert "did you mean 'place'?" in explained[1].description


# Poses


def pose_numbers(random: np.random.Generator) -> tuple[Any, Any]:
    """Return a random quaternion (x, y, z, w) and translation."""
    return Rotation.random(random_state=random).as_quat(), random.uniform(-10, 10, 3)


def fill(position: Any, orientation: Any, numbers: tuple[Any, Any]) -> None:
    (orientation.x, orientation.y, orientation.z, orientation.w), (position.x, position.y, position.z) = (
        map(float, part) for part in numbers
    )


def as_matrix(numbers: tuple[Any, Any]) -> Any:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = Rotation.from_quat(numbers[0]).as_matrix(), numbers[1]
    return matrix


def test_poses_of_topics_form_the_chain_that_scipy_computes(tmp_path: Path, node: Any, peer: Peer) -> None:
    numbers = [pose_numbers(np.random.default_rng(seed)) for seed in range(4)]
    stamped, odometry, transforms = PoseStamped(), Odometry(), [TransformStamped(), TransformStamped()]
    fill(stamped.pose.position, stamped.pose.orientation, numbers[0])
    fill(odometry.pose.pose.position, odometry.pose.pose.orientation, numbers[1])
    for transform, child_frame, transform_numbers in zip(transforms, ("mast", "arm"), numbers[2:], strict=True):
        transform.child_frame_id = child_frame
        fill(transform.transform.translation, transform.transform.rotation, transform_numbers)
    messages = "geometry_msgs/msg/"
    edges = (
        ("/amcl", f"{messages}PoseStamped", "localization", "world", "track", ""),
        ("/odom", "nav_msgs/msg/Odometry", "odometry", "track", "base", ""),
        ("/transforms", f"{messages}TransformStamped", "calibration", "base", "mast", "mast"),
        ("/transforms", f"{messages}TransformStamped", "hand", "mast", "arm", "arm"),
    )
    poses = [
        PoseTopic(
            topic=topic,
            type=kind,
            agent=agent,
            edge=f"{target}_pose",
            origin=origin,
            target=target,
            child_frame=child_frame,
        )
        for topic, kind, agent, origin, target, child_frame in edges
    ]
    clock = clock_of(node)
    with clock, started(FRAMES, tmp_path, clock) as codra, Bridge(codra, node, clock, poses=poses) as bridge:  # type: ignore[attr-defined]
        peer.publish(
            bridge,
            lambda: codra.get("near").known,
            (stamped, "/amcl", 10),
            (odometry, "/odom", 10),
            *((transform, "/transforms", 10) for transform in transforms),
        )
        pose = codra.knowledge.transform("world", "arm").pose

    expected = np.linalg.multi_dot([as_matrix(part) for part in numbers])
    assert np.abs(np.array(pose.matrix()) - expected).max() < 1e-9


def test_the_transforms_of_a_tf_message_are_those_that_scipy_computes() -> None:
    types = get_typestore(Stores.ROS2_JAZZY).types
    numbers = [pose_numbers(np.random.default_rng(seed)) for seed in range(20)]
    transforms = [
        types["geometry_msgs/msg/TransformStamped"](
            header=types["std_msgs/msg/Header"](
                types["builtin_interfaces/msg/Time"](sec=3, nanosec=500_000_000), "map"
            ),
            child_frame_id=f"link_{index}",
            transform=types["geometry_msgs/msg/Transform"](
                types["geometry_msgs/msg/Vector3"](*translation), types["geometry_msgs/msg/Quaternion"](*rotation)
            ),
        )
        for index, (rotation, translation) in enumerate(numbers)
    ]
    zero = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 0.0)
    transforms[3].transform.rotation = zero

    found = list(poses_in(types["tf2_msgs/msg/TFMessage"](transforms)))

    assert [pose.child_frame for pose in found] == [f"link_{index}" for index in range(20) if index != 3]
    assert {(pose.stamp_s, pose.frame) for pose in found} == {(3.5, "map")}
    del numbers[3]
    for pose, expected in zip(found, numbers, strict=True):
        assert np.abs(np.array(pose.pose.matrix()) - as_matrix(expected)).max() < 1e-9


# Simulated time


def write_bag(path: Path) -> None:
    """Write four seconds of a battery that is loaded, fails, and stops to be reported."""
    types = get_typestore(Stores.ROS2_JAZZY)
    kind = types.types["sensor_msgs/msg/BatteryState"]
    with Writer(path, version=9) as writer:
        connection = writer.add_connection("/battery_state", kind.__msgtype__, typestore=types)
        for index in range(60):
            stamp_ns = 1_000_000_000_000 + index * 50_000_000 + 5_000_000
            time = types.types["builtin_interfaces/msg/Time"](*divmod(stamp_ns, 10**9))
            fraction = math.nan if 30 <= index < 34 else index / 100
            constants = {name: value for name, _, value in types.fielddefs[kind.__msgtype__][0]}
            numbers = dict.fromkeys(("voltage", "temperature", "current", "charge", "capacity", "design_capacity"), 0.0)
            message = kind(
                header=types.types["std_msgs/msg/Header"](time, ""),
                **numbers,
                percentage=fraction,
                power_supply_status=constants["POWER_SUPPLY_STATUS_CHARGING"],
                power_supply_health=0,
                power_supply_technology=0,
                present=True,
                cell_voltage=np.array([3.5, 3.75], np.float32),
                cell_temperature=np.array([], np.float32),
                location="",
                serial_number="",
            )
            writer.write(connection, stamp_ns, types.serialize_cdr(message, kind.__msgtype__))
        writer.write(connection, stamp_ns + 1_500_000_000, types.serialize_cdr(message, kind.__msgtype__))


def decisions_of_bag(path: Path, rate: float, folder: Path) -> list[tuple[Any, ...]]:
    """Return the readings on which the cart decides, ten times a second in the time of the bag."""
    folder.mkdir()
    overrides = [rclpy.Parameter("use_sim_time", value=True)]
    node = rclpy.create_node("codra", parameter_overrides=overrides)
    command = [sys.executable, "-m", "tests.integrations.ros2.publisher", "bag", str(path), str(rate)]
    decisions: list[tuple[Any, ...]] = []
    with subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE) as player:
        clock = clock_of(node)
        with started(CART, folder, clock) as codra, Bridge(codra, node, clock) as bridge:

            def decide() -> None:
                value = codra.decide("ready", otherwise=lambda: None)
                reading = codra.get("charge")
                decisions.append((round(clock.now_s() - 1000.0, 3), value, reading.content, reading.evidence_s))

            for index in range(1, 43):
                clock.call_at(1000.0 + index / 10, decide)
            bridge.spin(lambda: len(decisions) == 42)
        assert player.stdin is not None
        player.stdin.close()
    node.destroy_node()
    return decisions


def test_without_a_clock_simulated_time_does_not_begin() -> None:
    node = rclpy.create_node("waiting", parameter_overrides=[rclpy.Parameter("use_sim_time", value=True)])

    with pytest.raises(TimeoutError, match=r"no message on /clock within 0\.2 s"):
        clock_of(node, timeout_s=0.2)

    node.destroy_node()


def test_a_bag_gives_the_same_decisions_at_double_speed(tmp_path: Path) -> None:
    write_bag(tmp_path / "bag")

    recorded_speed = decisions_of_bag(tmp_path / "bag", 1.0, tmp_path / "one")
    double_speed = decisions_of_bag(tmp_path / "bag", 2.0, tmp_path / "two")

    assert double_speed == recorded_speed
    assert recorded_speed[0] == (0.1, False, pytest.approx(1.0), pytest.approx(1000.055, abs=1e-6))
    assert {value for _, value, _, _ in recorded_speed} == {True, False, None}
