"""`python -m tests.campaigns.mutants [COUNT [FILE [SEED]]]`: print the detection figures of COUNT mutants.

One token is changed in each mutant. Each mutant is written to FILE, as a line of JSON.
"""

from __future__ import annotations

import random
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from tests.campaigns.mutants.judgement import Fate, Verdict, described, judge, original
from tests.campaigns.mutants.mutation import Slip, mutate, projects, tokens

SEED = 2026


def verdicts(count: int, seed: int = SEED) -> Iterator[Verdict]:
    """Yield verdicts on mutants of all valid specs of this repository, sampled uniformly over their tokens."""
    chance = random.Random(seed)
    by_name = projects()
    originals = {name: original(files) for name, files in by_name.items()}
    valid = [name for name in by_name if originals[name].is_valid]
    places = [(name, token) for name in valid for token in tokens(by_name[name])]
    for name, token in chance.sample(places, min(count, len(places))):
        yield judge(originals[name], mutate(by_name[name], token, chance))


def report(judged: Sequence[Verdict]) -> str:
    """Return the detection figures."""
    fates = Counter(verdict.fate for verdict in judged)
    changed = [verdict for verdict in judged if verdict.fate in (Fate.NEAR, Fate.FAR, Fate.MISSED)]
    detected = [verdict for verdict in judged if verdict.findings]
    suggested = [verdict for verdict in judged if verdict.suggestion is not None]
    correct = [verdict for verdict in suggested if verdict.suggestion is not None and verdict.suggestion[1]]
    findings = sum(len(verdict.findings) for verdict in detected)
    rows = [f"{len(judged)} mutants"]
    rows += [f"{fates[fate]:6} {fate}" for fate in Fate]
    for slip in Slip:
        missed = sum(verdict.fate is Fate.MISSED and verdict.mutant.slip is slip for verdict in judged)
        rows += [f"{missed:6} missed after {slip}"]
    rows += [
        f"{fates[Fate.NEAR] / max(1, len(changed)):6.1%} of those that change meaning are reported within one line",
        f"{fates[Fate.NEAR] / max(1, len(detected)):6.1%} of the reported ones are reported within one line",
        f"{len(correct) / max(1, len(suggested)):6.1%} of {len(suggested)} first suggestions are correct",
        f"{findings / max(1, len(detected)):6.2f} findings per mutant with any",
    ]
    return "\n".join(rows)


def main(count: int = 2500, file: str | None = None, seed: int = SEED) -> None:
    """Print the figures, with progress on a terminal."""
    judged = []
    for number, verdict in enumerate(verdicts(count, seed), start=1):
        judged.append(verdict)
        if sys.stderr.isatty():
            print(f"\r{number} of {count}", end="", file=sys.stderr)
    if file is not None:
        Path(file).write_text("".join(f"{described(verdict)}\n" for verdict in judged), "utf-8")
    print(report(judged))


if __name__ == "__main__":
    main(*(int(text) if text.isdigit() else text for text in sys.argv[1:]))  # type: ignore[arg-type]
