"""Runs `codra` in processes that are forked from a process which has imported the command already.

A forked process differs from a new one only in what it has imported: it has its own folder, environment and streams,
and it ends as every process does. It starts about ten times faster, and tests start a thousand of them.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import socket
import struct
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]

_IMPORTED_MODULES = (
    "codra_dsl.cli.app",
    "codra_dsl.compiler",
    "codra_dsl.tooling.report.findings",
    "codra_dsl.runtime",
)
_LENGTH = struct.Struct("!I")
_EXIT_CODE = struct.Struct("!i")
_MODULES_OF_COMMANDS = {
    "experiment": (
        "codra_papers.experiments.campaign.provenance",
        "codra_papers.experiments.campaign.results",
        "codra_papers.experiments.studies.lab_robustness",
        "codra_papers.experiments.studies.store_managers",
    ),
    "run": (
        "codra_papers.experiments.lab.report",
        "codra_papers.experiments.store.run",
        "codra_papers.store.page.server",
    ),
}
"""The modules that only one command needs. They are imported when this command is run for the first time."""

_SETTINGS_OF_NEW_PROCESSES = ("PYTHON", "LANG", "LC_")
"""The start of the names of environment variables that Python reads only when a process starts."""


def run_codra(
    arguments: tuple[str, ...], cwd: Path, environment: Mapping[str, str], stdin: bytes = b""
) -> subprocess.CompletedProcess[bytes]:
    """Run `codra` as a process and return its result.

    Args:
        arguments: the command line after `codra`.
        cwd: the folder of the process.
        environment: all environment variables of the process.
        stdin: what the process reads from its standard input.
    """
    if _settings_of_new_processes(environment) != _settings_of_new_processes(os.environ):
        command = [sys.executable, "-m", "codra_dsl", *arguments]
        return subprocess.run(command, cwd=cwd, env=environment, input=stdin, capture_output=True, check=False)
    with contextlib.ExitStack() as stack:
        streams = [stack.enter_context(tempfile.TemporaryFile()) for _ in range(3)]
        streams[0].write(stdin)
        streams[0].seek(0)
        request = {"arguments": arguments, "cwd": str(cwd), "environment": dict(environment)}
        exit_code = _server().run(json.dumps(request).encode(), [stream.fileno() for stream in streams])
        for stream in streams[1:]:
            stream.seek(0)
        return subprocess.CompletedProcess(arguments, exit_code, streams[1].read(), streams[2].read())


def as_text(process: subprocess.CompletedProcess[bytes]) -> subprocess.CompletedProcess[str]:
    """Return the result of a process with its output as text."""
    return subprocess.CompletedProcess(
        process.args, process.returncode, process.stdout.decode(), process.stderr.decode()
    )


def _settings_of_new_processes(environment: Mapping[str, str]) -> dict[str, str]:
    """Return the settings that need a new process, except the search path, which a forked process takes over."""
    return {
        name: value
        for name, value in environment.items()
        if name.startswith(_SETTINGS_OF_NEW_PROCESSES) and name != "PYTHONPATH"
    }


class _Server:
    """The process that forks; one for each process that runs tests, with which it ends."""

    def __init__(self) -> None:
        self._connection, other_end = socket.socketpair()
        with other_end:
            subprocess.run(
                [sys.executable, "-m", "tests.command_server", str(other_end.fileno())],
                cwd=ROOT,
                pass_fds=(other_end.fileno(),),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                check=True,
            )

    def run(self, request: bytes, streams: list[int]) -> int:
        """Run a command with these streams as its standard input, output and error; return its exit code."""
        socket.send_fds(self._connection, [_LENGTH.pack(len(request))], streams)
        self._connection.sendall(request)
        exit_code: int
        (exit_code,) = _EXIT_CODE.unpack(_receive(self._connection, _EXIT_CODE.size))
        return exit_code


@cache
def _server() -> _Server:
    return _Server()


def _receive(connection: socket.socket, size: int) -> bytes:
    data = b""
    while len(data) < size:
        part = connection.recv(size - len(data))
        if not part:
            raise EOFError("the other process has ended")
        data += part
    return data


def _serve(connection: socket.socket) -> None:
    """Fork a process for each request, one after another. Return in each forked process; end when nobody asks."""
    while True:
        header, streams, _, _ = socket.recv_fds(connection, _LENGTH.size, 3)
        if not header:
            sys.exit()
        request = json.loads(_receive(connection, *_LENGTH.unpack(header)))
        for argument in request["arguments"]:
            for module in _MODULES_OF_COMMANDS.get(argument, ()):
                importlib.import_module(module)
        process_id = os.fork()
        if process_id == 0:
            connection.close()
            _take_over(request, streams)
            return
        for stream in streams:
            os.close(stream)
        _, status = os.waitpid(process_id, 0)
        connection.sendall(_EXIT_CODE.pack(os.waitstatus_to_exitcode(status)))


def _take_over(request: dict[str, object], streams: list[int]) -> None:
    """Give this process the streams, folder, environment and search path of `python -m codra_dsl ...`."""
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    os.chdir(str(request["cwd"]))
    os.environ.clear()
    os.environ.update(request["environment"])  # type: ignore[call-overload]
    search_path = [path for path in os.environ.get("PYTHONPATH", "").split(os.pathsep) if path]
    sys.path[:] = list(dict.fromkeys([str(Path.cwd()), *search_path, *sys.path[1:]]))
    sys.argv = ["codra", *request["arguments"]]  # type: ignore[misc]


if __name__ == "__main__":
    if os.fork():
        os._exit(0)  # so that the server is no child of the tests, some of which count their children
    for _module in _IMPORTED_MODULES:
        importlib.import_module(_module)
    _serve(socket.socket(fileno=int(sys.argv[1])))
    from codra_dsl.cli import main

    main()
