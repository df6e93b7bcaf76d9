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
    files_by_project = projects()
    originals = {name: original(files) for name, files in files_by_project.items()}
    valid_names = [name for name in files_by_project if originals[name].is_valid]
    places = [(name, token) for name in valid_names for token in tokens(files_by_project[name])]
    for name, token in chance.sample(places, min(count, len(places))):
        yield judge(originals[name], mutate(files_by_project[name], token, chance))


def report(mutant_verdicts: Sequence[Verdict]) -> str:
    """Return the detection figures."""
    fates = Counter(verdict.fate for verdict in mutant_verdicts)
    changed_verdicts = [verdict for verdict in mutant_verdicts if verdict.fate in (Fate.NEAR, Fate.FAR, Fate.MISSED)]
    detected_verdicts = [verdict for verdict in mutant_verdicts if verdict.findings]
    suggested_verdicts = [verdict for verdict in mutant_verdicts if verdict.suggestion is not None]
    correct_suggestions = [
        verdict for verdict in suggested_verdicts if verdict.suggestion is not None and verdict.suggestion[1]
    ]
    findings = sum(len(verdict.findings) for verdict in detected_verdicts)
    rows = [f"{len(mutant_verdicts)} mutants"]
    rows += [f"{fates[fate]:6} {fate}" for fate in Fate]
    for slip in Slip:
        missed = sum(verdict.fate is Fate.MISSED and verdict.mutant.slip is slip for verdict in mutant_verdicts)
        rows += [f"{missed:6} missed after {slip}"]
    rows += [
        f"{fates[Fate.NEAR] / max(1, len(changed_verdicts)):6.1%} of those that change meaning "
        "are reported within one line",
        f"{fates[Fate.NEAR] / max(1, len(detected_verdicts)):6.1%} of the reported ones are reported within one line",
        f"{len(correct_suggestions) / max(1, len(suggested_verdicts)):6.1%} of {len(suggested_verdicts)} "
        "first suggestions are correct",
        f"{findings / max(1, len(detected_verdicts)):6.2f} findings per mutant with any",
    ]
    return "\n".join(rows)


def main(count: int = 2500, file: str | None = None, seed: int = SEED) -> None:
    """Print the figures, with progress on a terminal."""
    mutant_verdicts = []
    for number, verdict in enumerate(verdicts(count, seed), start=1):
        mutant_verdicts.append(verdict)
        if sys.stderr.isatty():
            print(f"\r{number} of {count}", end="", file=sys.stderr)
    if file is not None:
        Path(file).write_text("".join(f"{described(verdict)}\n" for verdict in mutant_verdicts), "utf-8")
    print(report(mutant_verdicts))


if __name__ == "__main__":
    main(*(int(text) if text.isdigit() else text for text in sys.argv[1:]))  # type: ignore[arg-type]
