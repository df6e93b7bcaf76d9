"""`python -m tests.mutants [COUNT [FILE [SEED]]]`: change one token COUNT times and print what was found.

Each mutant goes to FILE, as a line of JSON.
"""

from __future__ import annotations

import random
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from tests.mutants.judgement import Fate, Verdict, described, judge, original
from tests.mutants.mutation import Slip, mutate, projects, tokens

SEED = 2026


def verdicts(count: int, seed: int = SEED) -> Iterator[Verdict]:
    """Yield what became of mutants of all valid specs here, uniform over all their tokens."""
    chance = random.Random(seed)
    found = projects()
    originals = {name: original(files) for name, files in found.items()}
    valid = [name for name in found if originals[name].is_valid]
    places = [(name, token) for name in valid for token in tokens(found[name])]
    for name, token in chance.sample(places, min(count, len(places))):
        yield judge(originals[name], mutate(found[name], token, chance))


def report(judged: Sequence[Verdict]) -> str:
    """Return the figures of mutants."""
    fates = Counter(each.fate for each in judged)
    meant = [each for each in judged if each.fate in (Fate.NEAR, Fate.FAR, Fate.MISSED)]
    detected = [each for each in judged if each.findings]
    suggested = [each for each in judged if each.suggestion is not None]
    right = [each for each in suggested if each.suggestion is not None and each.suggestion[1]]
    findings = sum(len(each.findings) for each in detected)
    rows = [f"{len(judged)} mutants"]
    rows += [f"{fates[fate]:6} {fate}" for fate in Fate]
    for slip in Slip:
        missed = sum(each.fate is Fate.MISSED and each.mutant.slip is slip for each in judged)
        rows += [f"{missed:6} of the missed by {slip}"]
    rows += [
        f"{fates[Fate.NEAR] / max(1, len(meant)):6.1%} of those that change meaning are found within one line",
        f"{fates[Fate.NEAR] / max(1, len(detected)):6.1%} of those that are found are found within one line",
        f"{len(right) / max(1, len(suggested)):6.1%} of {len(suggested)} first suggestions are right",
        f"{findings / max(1, len(detected)):6.2f} findings per mutant with any",
    ]
    return "\n".join(rows)


def main(count: int = 2500, file: str | None = None, seed: int = SEED) -> None:
    """Print the figures, with progress on a terminal."""
    judged = []
    for number, each in enumerate(verdicts(count, seed), start=1):
        judged.append(each)
        if sys.stderr.isatty():
            print(f"\r{number} of {count}", end="", file=sys.stderr)
    if file is not None:
        Path(file).write_text("".join(f"{described(each)}\n" for each in judged), "utf-8")
    print(report(judged))


if __name__ == "__main__":
    main(*(int(text) if text.isdigit() else text for text in sys.argv[1:]))  # type: ignore[arg-type]
