"""The effect of a misbehaving perception process on other algorithms: the 99th percentile of their jobs' lateness.

The peer is the same robot without this process, plus 100 ms. `python benchmarks/isolation.py SPEC_FOLDER NAME` runs
one such robot.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from statistics import quantiles
from typing import Any

from misbehaving import LOOK_STARTS_S, MISBEHAVIOURS
from rows import Row

OTHER_COUNT = 4
PERIOD_S = 0.1
RUN_S = 20.0
ALLOWED_LATENESS_S = 0.1

_PERCEPTION = """\
  {name}:
    call: misbehaving:{function}
    returns: {{seen: {{type: bool}}}}
    timeout: 1 s
    identifies: {{{name}_seen: seen}}{more}
"""


def rows(scratch: Path) -> Iterator[Row]:
    """Measure a robot with each kind of misbehavior, and compare it with a robot without misbehavior."""
    (scratch / "pyproject.toml").write_text("[tool.codra]\n", "utf-8")
    (scratch / "robot.yaml").write_text(_spec(), "utf-8")
    compile_command = [sys.executable, "-m", "codra_dsl", "compile", "robot.yaml"]
    subprocess.run(compile_command, cwd=scratch, check=True, stdout=subprocess.DEVNULL)
    baseline = _robot(scratch, "none")
    for name in MISBEHAVIOURS:
        figures = _robot(scratch, name)
        description = (
            f"{name}: {figures['reason']} {figures['detail']}, p99 {figures['p99_s']:.4f} s of {figures['jobs']} jobs"
        )
        print(f"{description}; without it {baseline['p99_s']:.4f} s", file=sys.stderr)
        peer_s = baseline["p99_s"] + ALLOWED_LATENESS_S
        yield Row(name=f"isolated_{name}", ours=figures["p99_s"], peer=peer_s, target=1.0)


def _robot(scratch: Path, name: str) -> dict[str, Any]:
    """Run a robot with one misbehaving algorithm, and return its figures."""
    process = subprocess.run(
        [sys.executable, Path(__file__).absolute(), scratch, name], cwd=scratch, check=True, stdout=subprocess.PIPE
    )
    figures: dict[str, Any] = json.loads(process.stdout)
    return figures


def _spec() -> str:
    others = [f"other_{number}" for number in range(OTHER_COUNT)]
    names = [*others, *MISBEHAVIOURS]
    perception = [
        _PERCEPTION.format(name=name, function="look_at_once", more=f"\n    with: {{other: {number}}}")
        for number, name in enumerate(others)
    ]
    perception += [
        _PERCEPTION.format(name=name, function=name, more="\n    isolate: process") for name in MISBEHAVIOURS
    ]
    return "".join(
        (
            "codra: 1\nname: robot\ncontext:\n",
            *(f"  {name}_seen: {{type: bool, valid_for: 10 s}}\n" for name in names),
            "perception:\n",
            *perception,
            "observers:\n",
            *(f"  watch_{name}: {{identifies: [{name}_seen], period: {PERIOD_S} s}}\n" for name in others),
        )
    )


def main(scratch: Path, misbehaviour: str) -> None:
    """Run the robot: one algorithm misbehaves, while the other algorithms look all the time."""
    sys.path.insert(0, str(scratch))
    from codra_dsl.runtime import Kind, WallClock  # noqa: PLC0415 - the measuring parent does not need it
    from generated import robot  # noqa: PLC0415

    with WallClock() as clock, robot.start(clock=clock, resources={}) as codra:
        for number in range(OTHER_COUNT):
            codra.declare(f"other_{number}_seen")
        if misbehaviour in MISBEHAVIOURS:
            codra.declare(f"{misbehaviour}_seen")
        clock.sleep(RUN_S)
        readings = [codra.get(f"{name}_seen") for name in MISBEHAVIOURS if name == misbehaviour]
        jobs = codra.record.of(Kind.JOB)
    lateness_s: list[float] = []
    for other in range(OTHER_COUNT):
        job_starts = [job for job in jobs if job.name == f"other_{other}" and job.what == "started"]
        look_starts_s = (LOOK_STARTS_S.get((other, job.details["index"])) for job in job_starts[1:])
        due_s = [job.instant_s + PERIOD_S for job in job_starts]
        lateness_s += [at_s - due for at_s, due in zip(look_starts_s, due_s, strict=False) if at_s is not None]
    reasons_and_details = {
        "reason": [reading.reason for reading in readings],
        "detail": [reading.detail for reading in readings],
    }
    print(json.dumps({"p99_s": quantiles(lateness_s, n=100)[98], "jobs": len(lateness_s), **reasons_and_details}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2])
