"""Programs in C++ that the tests compile and drive."""

from __future__ import annotations

import json
import queue
import subprocess
import threading
from pathlib import Path
from typing import Any, Self

from codra_dsl.runtime.remote import INCLUDE_FOLDER

PATIENCE_S = 60.0
SOURCES = Path(__file__).parent / "cpp"
FLAGS = ("-std=c++17", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Werror", "-pthread")


def compile_program(source: Path, folder: Path, *options: str) -> Path:
    """Compile a program with all warnings, which are errors, and return its path."""
    program = folder / source.stem
    command = ("g++", *FLAGS, *options, "-I", INCLUDE_FOLDER, source, "-o", program)
    process = subprocess.run(command, capture_output=True, text=True, check=False)
    assert process.returncode == 0, process.stderr
    return program


class RefusedError(Exception):
    """The client in C++ raised an error: its kind, and its message."""


class Driver:
    """A running `driver.cpp`, which calls the client as the tests say."""

    def __init__(self, program: Path) -> None:
        self._process = subprocess.Popen(
            [program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        self._results: queue.Queue[dict[str, Any]] = queue.Queue()
        self._errors = ""
        self.readings: queue.Queue[dict[str, Any]] = queue.Queue()
        self._threads = [threading.Thread(target=self._read), threading.Thread(target=self._read_errors)]
        for thread in self._threads:
            thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, error_type: type[BaseException] | None, *_: object) -> None:
        """End the program, and assert that no sanitizer has found anything."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        for thread in self._threads:
            thread.join(PATIENCE_S)
        self._process.kill()  # a program that has ended keeps its exit code
        for thread in self._threads:
            thread.join()
        exit_code = self._process.wait()
        for stream in (self._process.stdout, self._process.stderr):
            stream.close()  # type: ignore[union-attr]
        if error_type is None:
            assert exit_code == 0, self._errors

    def call(self, what: str, **fields: object) -> dict[str, Any]:
        """Call the client and return the result.

        Raises:
            RefusedError: if the client raised an error.
        """
        self.begin(what, **fields)
        return self.result()

    def begin(self, what: str, **fields: object) -> None:
        """Begin a call of the client; get the result by `result`."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps({"call": what, **fields}).encode() + b"\n")
        self._process.stdin.flush()

    def result(self) -> dict[str, Any]:
        """Return the result of the next call."""
        answer = self._results.get(timeout=PATIENCE_S)
        if "error" in answer:
            raise RefusedError(answer["error"], answer["message"])
        return dict(answer["result"])

    def reading(self) -> dict[str, Any]:
        """Return the next reading of a subscription."""
        return self.readings.get(timeout=PATIENCE_S)

    @property
    def errors(self) -> str:
        """The text on standard error, after the end."""
        return self._errors

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            answer = json.loads(line)
            (self.readings if "subscription" in answer else self._results).put(answer)
        self._results.put({"error": "ended", "message": "the program has ended"})

    def _read_errors(self) -> None:
        assert self._process.stderr is not None
        self._errors = self._process.stderr.read().decode("utf-8", "replace")
