"""Runs `codra` and other Python programs in processes that are forked from a process with the imports that they need.

A forked process differs from a new one only in what it has imported: it has its own folder, environment and streams,
and it ends as every process does. It starts about ten times faster, and tests start more than a thousand of them.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import importlib
import json
import os
import runpy
import socket
import struct
import subprocess
import sys
import tempfile
import types
import warnings
from collections.abc import Mapping
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]

_IMPORTED_LIBRARIES = ("networkx", "pytest", "typer._adapters")
_PLUGINS_OF_PYTEST = {"anyio", "codra_dsl"}
_LENGTH = struct.Struct("!I")
_EXIT_CODE = struct.Struct("!i")
_PATIENCE_S = 240.0
"""A command that needs more time hangs."""
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

SETTINGS_OF_NEW_PROCESSES = ("PYTHON", "LANG", "LC_")
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
    return run_python(("-m", "codra_dsl", *arguments), cwd, environment, stdin)


def run_python(
    arguments: tuple[str, ...],
    cwd: Path,
    environment: Mapping[str, str],
    stdin: bytes = b"",
    *,
    is_output_merged: bool = False,
) -> subprocess.CompletedProcess[bytes]:
    """Run Python as a process and return its result.

    Args:
        arguments: the command line after `python`: at most `-W error`, then `-m MODULE`, `-c TEXT` or a file.
        cwd: the folder of the process.
        environment: all environment variables of the process.
        stdin: what the process reads from its standard input.
        is_output_merged: whether the standard error is a part of the standard output.
    """
    if _settings_of_new_processes(environment) != _settings_of_new_processes(os.environ):
        stderr = subprocess.STDOUT if is_output_merged else subprocess.PIPE
        command = [sys.executable, *arguments]
        return subprocess.run(
            command, cwd=cwd, env=environment, input=stdin, stdout=subprocess.PIPE, stderr=stderr, check=False
        )
    with contextlib.ExitStack() as stack:
        streams = [stack.enter_context(tempfile.TemporaryFile()) for _ in range(3)]
        streams[0].write(stdin)
        streams[0].seek(0)
        files = [stream.fileno() for stream in streams]
        request = {"arguments": arguments, "cwd": str(cwd), "environment": dict(environment)}
        exit_code = _server().run(json.dumps(request).encode(), files[:2] + files[1:2] if is_output_merged else files)
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
        if name.startswith(SETTINGS_OF_NEW_PROCESSES) and name != "PYTHONPATH"
    }


class _Server:
    """The process that forks; one for each process that runs tests, with which it ends."""

    def __init__(self) -> None:
        self._connection, other_end = socket.socketpair()
        self._connection.settimeout(_PATIENCE_S)
        atexit.register(self._connection.close)
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
        try:
            answer = _receive(self._connection, _EXIT_CODE.size)
        except TimeoutError:
            self._connection.close()  # the next command gets another server
            _server.cache_clear()
            raise
        exit_code: int
        (exit_code,) = _EXIT_CODE.unpack(answer)
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


def _modules_of_the_product() -> list[str]:
    """Return all modules but those of integrations, some of which import libraries that commands rarely need."""
    paths = (path.relative_to(ROOT).with_suffix("") for path in sorted((ROOT / "codra_dsl").rglob("*.py")))
    return [".".join(path.parts) for path in paths if not {"__init__", "__main__", "integrations"} & set(path.parts)]


def _serve(connection: socket.socket) -> list[str]:
    """Fork a process for each request, one after another. Return its arguments in each; end when nobody asks."""
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
            for name in _PLUGINS_OF_PYTEST & sys.modules.keys():
                sys.modules[name].__doc__ = "PYTEST_DONT_REWRITE"  # pytest warns of plugins that are imported before it
            _take_over(request, streams)
            return request["arguments"]
        for stream in streams:
            os.close(stream)
        _, status = os.waitpid(process_id, 0)
        connection.sendall(_EXIT_CODE.pack(os.waitstatus_to_exitcode(status)))


def _take_over(request: dict[str, object], streams: list[int]) -> None:
    """Give this process the streams, folder, environment and search path of `python -m ...`."""
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    os.chdir(str(request["cwd"]))
    os.environ.clear()
    os.environ.update(request["environment"])  # type: ignore[call-overload]
    search_path = [path for path in os.environ.get("PYTHONPATH", "").split(os.pathsep) if path]
    sys.path[:] = list(dict.fromkeys([str(Path.cwd()), *search_path, *sys.path[1:]]))


def _run(arguments: list[str]) -> None:
    """Run a program as `python` does with these arguments."""
    if arguments[:2] == ["-W", "error"]:
        warnings.simplefilter("error")
        arguments = arguments[2:]
    if arguments[0] == "-m":
        sys.argv = arguments[1:]
        runpy.run_module(arguments[1], run_name="__main__", alter_sys=True)
    elif arguments[0] == "-c":
        sys.argv = ["-c", *arguments[2:]]
        sys.path[0] = ""
        program = sys.modules["__main__"] = types.ModuleType("__main__")
        exec(compile(arguments[1], "<string>", "exec"), program.__dict__)
    else:
        sys.argv = arguments
        sys.path[0] = str(Path(arguments[0]).resolve().parent)
        runpy.run_path(arguments[0], run_name="__main__")


if __name__ == "__main__":
    if os.fork():
        os._exit(0)  # so that the server is no child of the tests, some of which count their children
    for _module in (*_modules_of_the_product(), *_IMPORTED_LIBRARIES):
        importlib.import_module(_module)
    gc.collect()
    gc.freeze()  # a forked process would copy the pages of all these objects when it collects garbage
    _run(_serve(socket.socket(fileno=int(sys.argv[1]))))
