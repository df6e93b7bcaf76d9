"""Programs that publish in a process of their own: ten topics at 50 Hz, or the messages of a bag.

`python -m tests.integrations.ros2.publisher topics` publishes until its standard input is closed. It prints the first
stamp in ns; message number k has the stamp k periods later. `... bag PATH RATE` plays a bag, with `/clock`.
"""

from __future__ import annotations

import sys
import threading
import time
from pathlib import Path
from typing import Any

import rclpy
from geometry_msgs.msg import PointStamped
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from rosbags.rosbag2 import Reader
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import BatteryState

PERIOD_NS = 20_000_000
TOPICS = 10
CLOCK_PERIOD_NS = 10_000_000
WAIT_S = 0.05


def publish_topics() -> None:
    """Publish the number of each message in ten topics, half of them with best effort, until the input is closed."""
    is_over = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), is_over.set()), daemon=True).start()
    node = rclpy.create_node("robot")
    profiles = [qos_profile_sensor_data if number % 2 else QoSProfile(depth=10) for number in range(TOPICS)]
    publishers = [
        node.create_publisher(PointStamped, f"/sensor_{number}", profile) for number, profile in enumerate(profiles)
    ]
    while not all(publisher.get_subscription_count() for publisher in publishers) and not is_over.is_set():
        time.sleep(WAIT_S)
    start_ns = time.time_ns()
    sys.stdout.write(f"{start_ns}\n")
    sys.stdout.flush()
    index = 0
    while not is_over.is_set():
        stamp_ns = start_ns + index * PERIOD_NS
        time.sleep(max(0, stamp_ns - time.time_ns()) / 1e9)
        message = PointStamped()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
        message.point.x = float(index)
        for publisher in publishers:
            publisher.publish(message)
        index += 1


def play_bag(path: Path, rate: float) -> None:
    """Publish the messages of a bag and `/clock`, `rate` times as fast as they were recorded."""
    node = rclpy.create_node("player")
    with Reader(path) as reader:
        messages = [(stamp_ns, connection.topic, bytes(raw)) for connection, stamp_ns, raw in reader.messages()]
        start_ns, end_ns = reader.start_time - CLOCK_PERIOD_NS, reader.end_time
    publishers = {
        topic: node.create_publisher(BatteryState, topic, 100) for topic in {topic for _, topic, _ in messages}
    }
    clock = node.create_publisher(Clock, "/clock", QoSProfile(depth=1000))
    while not all(publisher.get_subscription_count() for publisher in publishers.values()):
        clock.publish(clock_message(start_ns))
        time.sleep(WAIT_S)
    begin_ns = time.monotonic_ns()
    for now_ns in range(start_ns, end_ns + CLOCK_PERIOD_NS, CLOCK_PERIOD_NS):
        time.sleep(max(0.0, (now_ns - start_ns) / rate - (time.monotonic_ns() - begin_ns)) / 1e9)
        while messages and messages[0][0] <= now_ns:
            _, topic, raw = messages.pop(0)
            publishers[topic].publish(raw)
        clock.publish(clock_message(now_ns))
    sys.stdin.read()  # until the reader has everything


def clock_message(now_ns: int) -> Any:
    message = Clock()
    message.clock.sec, message.clock.nanosec = divmod(now_ns, 10**9)
    return message


if __name__ == "__main__":
    rclpy.init()
    if sys.argv[1] == "topics":
        publish_topics()
    else:
        play_bag(Path(sys.argv[2]), float(sys.argv[3]))
    rclpy.shutdown()
