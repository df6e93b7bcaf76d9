"""Programs on a network that end or fail at random instants: does each of them end within two seconds?

python -m tests.campaigns.endings RUNS SEED
"""

from __future__ import annotations

import signal
import subprocess
import sys
import tempfile
import textwrap
import time
from collections import Counter
from pathlib import Path
from random import Random

from tests.campaigns.namespaces import FILES
from tests.runtime.remote.test_network import free_port

ROOT = Path(__file__).parents[2]
LIMIT_S = 2.0
PATIENCE_S = 60.0

PROGRAM = """
    import sys, threading, time
    from codra_dsl.runtime.remote import NetworkAddress, RemoteContext

    endpoint, how, seconds = sys.argv[1], sys.argv[2], float(sys.argv[3])
    codra = RemoteContext(NetworkAddress(endpoint))
    codra.subscribe("door_open", lambda reading: None)
    codra.declare("door_open")
    print("ready", flush=True)
    end_s = time.monotonic() + seconds
    try:
        while time.monotonic() < end_s:
            codra.decide("door_open", lambda: False, wait_up_to_s=0.2)
    finally:
        print("end", flush=True)
    if how == "closes":
        codra.close()
    if how == "raises":
        raise ValueError("the program fails")
    """


def start(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    """Start a program whose output goes to the file `NUMBER.log`, where NUMBER is its process ID."""
    environment = {"PYTHONPATH": f"{ROOT}:{folder}", "PATH": "/usr/bin:/bin"}
    log = folder / "program.log"
    with log.open("w", encoding="utf-8") as output:
        program = subprocess.Popen(
            [sys.executable, *arguments], cwd=folder, env=environment, text=True, stdout=output, stderr=output
        )
    log.rename(folder / f"{program.pid}.log")
    return program


def await_text(folder: Path, program: subprocess.Popen[str], text: str) -> None:
    log, end_s = folder / f"{program.pid}.log", time.monotonic() + PATIENCE_S
    while text not in log.read_text(encoding="utf-8"):
        assert time.monotonic() < end_s, f"no {text!r} in {log.read_text(encoding='utf-8')}"
        time.sleep(0.01)


def one_run(folder: Path, random: Random) -> tuple[str, float]:
    """Return what ended, and how long it took."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    serve = start(folder, "-m", "codra_dsl", "serve", "specs/door.yaml", "--listen", endpoint)
    await_text(folder, serve, "serving")
    host = start(folder, "-m", "codra_dsl", "host", "arm_pc", "specs/door.yaml", "--connect", endpoint)
    how = random.choice(("closes", "leaves open", "raises"))
    client = start(folder, "-c", textwrap.dedent(PROGRAM), endpoint, how, str(random.uniform(0.0, 1.5)))
    programs = {"serve": serve, "host": host, "client": client}
    try:
        await_text(folder, client, "ready")
        fault = random.choice(("none", "none", "the manager is killed", "the host is killed", "the manager is stopped"))
        time.sleep(random.uniform(0.0, 0.5))
        if fault != "none":
            victim = serve if "manager" in fault else host
            victim.send_signal(signal.SIGSTOP if "stopped" in fault else signal.SIGKILL)
        name = random.choice(("client", "host", "serve")) if fault == "none" else "client"
        program = programs[name]
        if name == "client":
            await_text(folder, program, "end")
        else:
            program.send_signal(random.choice((signal.SIGINT, signal.SIGTERM)))
        start_s = time.monotonic()
        program.wait(timeout=PATIENCE_S)
        return f"{name}, {fault}", time.monotonic() - start_s
    finally:
        for program in programs.values():
            program.send_signal(signal.SIGCONT)
            program.kill()
            program.wait()


def main(run_count: int, seed: int) -> int:
    """Make some runs; return 1 if a program took longer than the limit."""
    random, counts, slowest_s = Random(seed), Counter[str](), Counter[str]()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for name, text in FILES.items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(textwrap.dedent(text), encoding="utf-8")
        for number in range(run_count):
            what, took_s = one_run(folder, random)
            counts[what] += 1
            slowest_s[what] = max(slowest_s[what], took_s)  # type: ignore[assignment]
            if took_s > LIMIT_S:
                print(f"run {number}: {what} took {took_s:.2f} s", flush=True)
            if number % 20 == 19:
                print(f"{number + 1} of {run_count} runs, slowest end {max(slowest_s.values()):.2f} s", flush=True)
    for what, count in sorted(counts.items()):
        print(f"{count:4} times {what}: at most {slowest_s[what]:.2f} s")
    return int(max(slowest_s.values()) > LIMIT_S)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), int(sys.argv[2])))
