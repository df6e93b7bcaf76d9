"""The programs of docs/how-to/ros2.md, run as a reader would run them."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import rclpy
from rcl_interfaces.msg import Parameter, ParameterType
from rcl_interfaces.srv import DescribeParameters
from rclpy.qos import DurabilityPolicy, QoSProfile

from codra_dsl.compiler import compile_paths
from tests.test_docs import ROOT, blocks

PAGE = ROOT / "docs/how-to/ros2.md"
LIMIT_S = 60


def write_page(folder: Path) -> None:
    for block in blocks(PAGE):
        if "file" in block.options:
            path = folder / block.options["file"]
            path.parent.mkdir(exist_ok=True)
            path.write_text(block.body)
    for path, text in compile_paths([folder / "specs/cart.yaml"], folder).files.items():
        (folder / "generated" / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / "generated" / path).write_text(text)


def test_the_programs_of_the_guide_answer_services_and_leave_a_journal(tmp_path: Path) -> None:
    write_page(tmp_path)
    node = rclpy.create_node("reader")
    charges: list[Parameter] = []
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(Parameter, "/codra/context/charge", charges.append, latched)
    programs = [
        subprocess.Popen([sys.executable, name], cwd=tmp_path, stderr=subprocess.PIPE, text=True)
        for name in ("cart_node.py", "cart_robot.py")
    ]
    limit_s = time.monotonic() + LIMIT_S
    while not charges or charges[-1].value.type == ParameterType.PARAMETER_NOT_SET:
        assert [program.poll() for program in programs] == [None, None]
        assert time.monotonic() < limit_s, charges
        rclpy.spin_once(node, timeout_sec=0.1)
    answers = []
    for service, name in (("preview", "drive"), ("why", "charge")):
        client = node.create_client(DescribeParameters, f"/codra/{service}")
        assert client.wait_for_service(LIMIT_S)
        answer = client.call_async(DescribeParameters.Request(names=[name]))
        rclpy.spin_until_future_complete(node, answer, timeout_sec=LIMIT_S)
        answers.append(answer.result().descriptors[0].description)
    programs[0].send_signal(signal.SIGINT)
    programs[1].terminate()
    errors = [program.communicate(timeout=LIMIT_S)[1] for program in programs]
    node.destroy_node()
    command = [sys.executable, "-m", "codra_dsl", "why", "charge", "--journal", "cart.mcap"]
    explained = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)

    assert abs(charges[-1].value.double_value - 80.0) < 1e-3
    assert answers[0].startswith(("holds", "unknown: door_open"))
    assert answers[1].startswith("charge is 80")
    assert "written by agent base" in answers[1]
    assert "written by agent base" in explained.stdout, explained.stderr
    assert errors[0] == ""
