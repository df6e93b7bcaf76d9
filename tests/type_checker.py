"""Runs mypy with the cache that `make lint` fills, so that it does not check the product again for each test."""

from __future__ import annotations

import fcntl
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).parents[1]
CACHE = ROOT / ".mypy_cache"


def run_mypy(
    *arguments: str, cwd: Path = ROOT, environment: Mapping[str, str] = os.environ
) -> subprocess.CompletedProcess[str]:
    """Run `mypy --strict`, one process at a time, with the error codes of this repository, on which the cache depends.

    Args:
        arguments: further arguments.
        cwd: the folder of the process, whose settings mypy reads.
        environment: all environment variables of the process.
    """
    CACHE.mkdir(exist_ok=True)
    settings = ("--strict", "--enable-error-code", "ignore-without-code", "--cache-dir", str(CACHE))
    with (CACHE / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        return subprocess.run(
            [sys.executable, "-m", "mypy", *settings, *arguments],
            cwd=cwd,
            env=environment,
            text=True,
            capture_output=True,
            check=False,
            stdin=subprocess.DEVNULL,
        )
