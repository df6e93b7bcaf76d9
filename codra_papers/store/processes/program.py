"""The program of one agent: `python -m codra_papers.store.processes.program NAME PACKAGE MANAGER BODY`.

It ends when the connection to the manager or to the body has ended, or when an event of the agent has failed.
"""

from __future__ import annotations

import os
import sys
from functools import partial
from pathlib import Path

from codra_dsl.integrations.inspection import load_package
from codra_dsl.runtime.remote import RemoteContext
from codra_papers.store.agents import AGENTS
from codra_papers.store.processes.event_clock import EventClock
from codra_papers.store.processes.remote_body import RemoteBody

KEY_VARIABLE = "CODRA_STORE_BODY_KEY"
"""The environment variable with the key of the body's server, in hexadecimal digits."""


def main(name: str, package_folder: str, manager: str, body: str) -> None:
    """Run an agent until a connection ends, or an event of the agent fails.

    Args:
        name: the name of the agent.
        package_folder: the folder of the generated package.
        manager: the Unix socket of the manager.
        body: the Unix socket of the body.
    """
    end = partial(_end, name)
    clock = EventClock(on_error=end)
    try:
        context = RemoteContext(Path(manager))
        knowledge = context.knowledge(load_package(Path(package_folder)), clock=clock)
        key = bytes.fromhex(os.environ[KEY_VARIABLE])
        remote_body = RemoteBody(Path(body), key, clock, on_lost=lambda: end("the robot's body is gone"))
        agent = AGENTS[name](knowledge, remote_body, clock)
        clock.call_at(clock.now_s(), _report_readiness)  # after the first events of the agent
        reason = context.wait_until_lost()
    except (ConnectionError, EOFError, LookupError, PermissionError) as error:
        end(error)
    else:
        del agent  # it has worked until now
        end(reason)


def _report_readiness() -> None:
    sys.stdout.write("ready\n")
    sys.stdout.flush()


def _end(name: str, reason: object) -> None:
    """End the process from any thread."""
    sys.stderr.write(f"agent {name} ends: {reason}\n")
    sys.stderr.flush()
    os._exit(1)


if __name__ == "__main__":
    main(*sys.argv[1:])
