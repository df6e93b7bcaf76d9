"""A manager and its host in two network namespaces: decisions, a cut link, and programs that are killed or stopped.

    python -m tests.campaigns.namespaces

It needs the rights to make network namespaces, and `ip` of iproute2.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import textwrap
import time
from collections.abc import Callable, Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
LIMIT_S = 2.0
"""Within this time, a loss must be noticed."""

PATIENCE_S = 60.0

FILES = {
    "pyproject.toml": "[tool.codra]\n",
    "specs/door.yaml": """
        codra: 1
        name: door
        context:
          door_open: {type: bool, valid_for: 60 s}
          door_locked: {type: bool, valid_for: 60 s}
          battery_low: {type: bool, valid_for: 60 s}
        perception:
          look_at_door:
            call: looks:door
            host: arm_pc
            returns: {angle: {type: float, unit: rad}}
            identifies: {door_open: angle > 30 deg}
          look_at_lock:
            call: looks:lock
            host: arm_pc
            returns: {is_locked: {type: bool}}
            identifies: {door_locked: is_locked}
          ask_lock:
            call: looks:lock
            rank: 2
            returns: {is_locked: {type: bool}}
            identifies: {door_locked: is_locked}
          read_battery:
            call: looks:battery
            returns: {level: {type: float, unit: percent}}
            identifies: {battery_low: level < 20 percent}
        """,
    "looks.py": """
        def door(*, job):
            job.evidence(job.now_s(), job.now_s())
            job.sleep(0.05)
            return {"angle": 1.2}

        def lock(*, job):
            return {"is_locked": False}

        def battery(*, job):
            return {"level": 80.0}
        """,
    "client.py": """
        import sys, json, time
        from pathlib import Path
        from codra_dsl.runtime.remote import NetworkAddress, RemoteContext

        names = ("door_open", "door_locked", "battery_low")

        def connected(seconds=60):
            for _ in range(seconds):
                try:
                    return RemoteContext(NetworkAddress(sys.argv[1], Path(sys.argv[2])))
                except ConnectionError:
                    time.sleep(1.0)

        with connected() as codra:
            for name in names:
                codra.declare(name)
            for line in sys.stdin:
                if line == "decide\\n":
                    answers = [codra.decide(name, lambda: "none", wait_up_to_s=10.0) for name in names]
                    print(json.dumps(answers), flush=True)
                    continue
                try:
                    readings = [codra.get(name) for name in names]
                except ConnectionError as error:
                    print(json.dumps(str(error)), flush=True)
                    break
                answers = [[reading.content, str(reading.reason), reading.detail] for reading in readings]
                print(json.dumps(answers), flush=True)
        """,
}


def run(*command: str) -> None:
    subprocess.run(command, check=True, capture_output=True)


@contextlib.contextmanager
def namespaces() -> Iterator[tuple[str, str]]:
    """Yield two network namespaces with a cable between them: 10.78.0.1 and 10.78.0.2."""
    names = (f"codra-{os.getpid()}-a", f"codra-{os.getpid()}-b")
    try:
        for name in names:
            run("ip", "netns", "add", name)
            run("ip", "-n", name, "link", "set", "lo", "up")
        run("ip", "-n", names[0], "link", "add", "cable", "type", "veth", "peer", "name", "cable", "netns", names[1])
        for number, name in enumerate(names, 1):
            run("ip", "-n", name, "address", "add", f"10.78.0.{number}/24", "dev", "cable")
            run("ip", "-n", name, "link", "set", "cable", "up")
        yield names
    finally:
        for name in names:
            subprocess.run(["ip", "netns", "delete", name], check=False, capture_output=True)


class Robot:
    """The programs of a robot in two namespaces."""

    def __init__(self, folder: Path, names: tuple[str, str]) -> None:
        self.folder = folder
        self.names = names
        self.manager = self.start_manager()
        self.host = self.start_host()
        self.client = self.start_client()

    def start(self, namespace: str, *arguments: str, **options: object) -> subprocess.Popen[str]:
        command = ["ip", "netns", "exec", namespace, sys.executable, *arguments]
        environment = {**os.environ, "PYTHONPATH": f"{ROOT}:{self.folder}"}
        return subprocess.Popen(command, cwd=self.folder, env=environment, text=True, **options)  # type: ignore[call-overload, no-any-return]

    def start_manager(self) -> subprocess.Popen[str]:
        credentials = ("--credentials", "keys/manager.json5")
        return self.start(
            self.names[0], "-m", "codra_dsl", "serve", "specs/door.yaml", "--listen", ENDPOINT, *credentials
        )

    def start_host(self) -> subprocess.Popen[str]:
        credentials = ("--credentials", "keys/arm_pc.json5")
        return self.start(
            self.names[1], "-m", "codra_dsl", "host", "arm_pc", "specs/door.yaml", "--connect", ENDPOINT, *credentials
        )

    def start_client(self) -> subprocess.Popen[str]:
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        return self.start(self.names[0], "client.py", ENDPOINT, "keys/main_execution.json5", **pipes)

    def ask(self, what: str) -> list[object]:
        assert self.client.stdin is not None
        assert self.client.stdout is not None
        self.client.stdin.write(f"{what}\n")
        self.client.stdin.flush()
        line = self.client.stdout.readline()
        if not line:
            raise ConnectionError("the client has ended")
        answers: list[object] | str = json.loads(line)
        if isinstance(answers, str):
            raise ConnectionError(answers)
        return answers

    def close(self) -> None:
        for program in (self.client, self.host, self.manager):
            program.send_signal(signal.SIGCONT)
            program.kill()
            program.wait()


ENDPOINT = "tls/10.78.0.1:7447"


def awaited_s(is_ready: Callable[[], bool]) -> float:
    start_s = time.monotonic()
    while not is_ready():
        assert time.monotonic() < start_s + PATIENCE_S, "it does not happen"
        time.sleep(0.02)
    return time.monotonic() - start_s


def check_losses(robot: Robot) -> None:
    cable = ("ip", "-n", robot.names[0], "link", "set", "cable")

    def cut() -> None:
        run(*cable, "down")

    def mend() -> None:
        time.sleep(10.0)
        run(*cable, "up")

    def restart() -> None:
        robot.host.wait()
        robot.host = robot.start_host()

    losses = {
        "the link is cut for 10 s": (cut, mend),
        "the host is stopped": (
            lambda: robot.host.send_signal(signal.SIGSTOP),
            lambda: robot.host.send_signal(signal.SIGCONT),
        ),
        "the host is killed": (robot.host.kill, restart),
    }
    for name, (lose, recover) in losses.items():
        lose()
        lost_s = awaited_s(lambda: robot.ask("get")[0][1] == "unreachable")  # type: ignore[index]
        door, lock, battery = robot.ask("get")
        assert "host 'arm_pc' is not connected" in door[2], door  # type: ignore[index]
        assert lock[:2] == [False, "None"], lock  # type: ignore[index]
        assert battery[:2] == [False, "None"], battery  # type: ignore[index]
        recover()
        recovered_s = awaited_s(lambda: robot.ask("get")[0][0] is True)  # type: ignore[index]
        print(f"{name}: unreachable after {lost_s:.2f} s, known again {recovered_s:.2f} s after the return", flush=True)
        assert lost_s <= LIMIT_S


def check_end_of_manager(robot: Robot) -> None:
    for name, signal_number in (("stopped", signal.SIGSTOP), ("killed", signal.SIGKILL)):
        robot.manager.send_signal(signal_number)
        lost_s = awaited_s(lambda: is_gone(robot))
        print(f"the manager is {name}: its client is told after {lost_s:.2f} s", flush=True)
        assert lost_s <= LIMIT_S
        robot.manager.send_signal(signal.SIGCONT)
        robot.manager.kill()
        robot.manager.wait()
        robot.client.wait()
        robot.manager = robot.start_manager()
        robot.client = robot.start_client()
        recovered_s = awaited_s(lambda: robot.ask("get")[0][0] is True)  # type: ignore[index]
        print(f"the host serves the next manager after {recovered_s:.2f} s", flush=True)


def is_gone(robot: Robot) -> bool:
    try:
        robot.ask("get")
    except (ConnectionError, BrokenPipeError):
        return True
    return False


def decisions_of_one_process(folder: Path) -> list[object]:
    program = """
        import json
        from codra_dsl.integrations.inspection import compile_and_load
        from codra_dsl.runtime import WallClock
        from pathlib import Path

        package = compile_and_load(Path("specs/door.yaml"), Path("generated_here")).package
        names = ("door_open", "door_locked", "battery_low")
        with package.start(clock=WallClock(), resources={}, hosts_here=True) as codra:
            for name in names:
                codra.declare(name)
            print(json.dumps([codra.decide(name, lambda: "none", wait_up_to_s=10.0) for name in names]))
        """
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}:{folder}"}
    command = [sys.executable, "-c", textwrap.dedent(program)]
    result = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=True)
    answers: list[object] = json.loads(result.stdout)
    return answers


def main() -> None:
    """Run the checks, and print what they measure."""
    with tempfile.TemporaryDirectory() as temporary, namespaces() as names:
        folder = Path(temporary)
        for name, text in FILES.items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(textwrap.dedent(text), encoding="utf-8")
        command = (sys.executable, "-m", "codra_dsl", "serve", "specs/door.yaml", "--listen", ENDPOINT)
        subprocess.run([*command, "--write-security", "keys"], cwd=folder, check=True, capture_output=True)
        robot = Robot(folder, names)
        try:
            awaited_s(lambda: robot.ask("get")[0][0] is True)  # type: ignore[index]
            decisions = robot.ask("decide")
            assert decisions == decisions_of_one_process(folder), decisions
            print(f"decisions as in one process: {decisions}", flush=True)
            check_losses(robot)
            check_end_of_manager(robot)
        finally:
            robot.close()
    print("all as expected")


if __name__ == "__main__":
    main()
