"""Attack a server with many clients: `python -m tests.campaigns.clients CLIENTS [SECONDS [SEED]]`.

The campaign fails if the memory of the server reaches 200 MB, if an ordinary client waits longer than 100 ms for one of
a hundred answers, or if descriptors are not released after the lease.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from codra_dsl.runtime.remote.json_lines import RESPONSE_TIMEOUT_S
from codra_dsl.runtime.remote.session import LEASE_S
from tests.campaigns.clients.measuring import Measuring, Resources, Waits

QUIET_S = 5.0
SETTLE_S = 2.0
"""After the quiet time, until the descriptors of a server that has begun, and has no client, are counted."""

MAX_MEMORY_MB = 200.0
MAX_WAIT_S = 0.1
RELEASE_S = LEASE_S + RESPONSE_TIMEOUT_S + 2.0


def main(client_count: int, duration_s: float, seed: int) -> int:
    """Attack for some seconds; return 1 if a limit was exceeded."""
    with (
        tempfile.TemporaryDirectory(prefix="codra-clients-") as folder,
        _process("served", f"{folder}/codra.sock") as (message_server, _),
        _process("served") as (page_server, port),
    ):
        _measure(Measuring(f"{folder}/codra.sock", port), QUIET_S, "without an attack")
        time.sleep(SETTLE_S)
        servers = [Resources("messages", message_server.pid), Resources("page", page_server.pid)]
        measuring = Measuring(f"{folder}/codra.sock", port)
        with _process("attacking", f"{folder}/codra.sock", str(port), str(client_count), str(seed)) as (_, begun):
            mistakes = _measure(measuring, duration_s, f"{begun} clients attack, seed {seed}")
        time.sleep(RELEASE_S)
        for server in servers:
            mistakes += _judge_resources(server)
    print(f"mistakes: {len(mistakes)}")
    for mistake in mistakes:
        print(f"  {mistake}")
    return 1 if mistakes else 0


def _judge_resources(server: Resources) -> Iterator[str]:
    """Print the resources of a server, and yield its mistakes."""
    server.end()
    before_mb, memory_mb, after_mb = server.memory_before_mb, server.memory_mb("VmHWM"), server.memory_mb()
    before, descriptors = server.descriptors_before, server.descriptors()
    print(f"server of {server.name}:")
    print(f"  {before_mb:.0f} MB before, {memory_mb:.0f} at most, {after_mb:.0f} afterwards")
    print(f"  {before} descriptors before, {server.most_descriptors} at most, {descriptors} afterwards")
    cpu_s, delay_s = server.cpu_and_delay_s()
    print(f"  {server.most_threads} threads at most; {cpu_s:.1f} s of CPU, {delay_s:.1f} s of waiting for a core")
    if memory_mb >= MAX_MEMORY_MB:
        yield f"server of {server.name}: memory {memory_mb:.0f} MB"
    if descriptors > server.descriptors_before:
        yield f"server of {server.name}: {descriptors - server.descriptors_before} descriptors were not released"


def _measure(measuring: Measuring, duration_s: float, name: str) -> list[str]:
    """Measure for some seconds, print the figures, and return the mistakes."""
    time.sleep(duration_s)
    measuring.end()
    print(f"{name}, {duration_s:g} s, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores:")
    return [mistake for waits in measuring.waits for mistake in _judge(waits)]


def _judge(waits: Waits) -> Iterator[str]:
    """Print the figures of an ordinary client, and yield its mistakes."""
    median_s, p99_s = waits.quantile(0.5), waits.quantile(0.99)
    figures = f"median {median_s * 1e3:.1f} ms, p99 {p99_s * 1e3:.1f} ms, longest {waits.quantile(1.0) * 1e3:.1f} ms"
    print(f"  {waits.name}: {len(waits.seconds)} answers, {figures}, {len(waits.refusals)} refused")
    for reason, count in Counter(waits.refusals).most_common(3):
        print(f"    {count}: {reason}")
    if p99_s > MAX_WAIT_S:
        yield f"{waits.name}: p99 {p99_s * 1e3:.0f} ms"


@contextmanager
def _process(module: str, *arguments: str) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """Run a module of this campaign until the block ends; yield the process and the number that it prints."""
    with subprocess.Popen(
        [sys.executable, "-m", f"tests.campaigns.clients.{module}", *arguments],
        cwd=Path(__file__).parents[3],
        text=True,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            yield process, int(process.stdout.readline())
        finally:
            process.stdin.close()
            try:
                process.wait(timeout=30.0)
            except subprocess.TimeoutExpired:
                process.kill()


if __name__ == "__main__":
    clients, *options = sys.argv[1:]
    sys.exit(main(int(clients), float(options[0]) if options else 30.0, int(options[1]) if options[1:] else 1))
