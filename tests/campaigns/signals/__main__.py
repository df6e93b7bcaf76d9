"""Send signals to programs and report the losses: `python -m tests.campaigns.signals RUNS SEED [COMMANDS]`."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from random import Random

from tests.campaigns.signals.trial import ATTACKS, CLOCKS, Outcome, command_trial, writer_trial


def main(runs: int, seed: int, commands: int) -> int:
    """Run the trials; return 1 if a journal lost an acknowledged write, or is damaged."""
    chance = Random(seed)
    variants = [(CLOCKS[(index + index // 4) % 2], ATTACKS[index % 4]) for index in range(runs)]
    with tempfile.TemporaryDirectory(prefix="codra-signals-") as folder:
        outcomes = [
            writer_trial(Path(folder) / f"{index}.mcap", clock, attack, chance.randrange(1 << 30))
            for index, (clock, attack) in enumerate(variants)
        ]
        outcomes += [
            command_trial(Path(folder) / f"command {index}.mcap", ATTACKS[index % 2], chance)
            for index in range(commands)
        ]
    return _report(outcomes, seed)


def _report(outcomes: list[Outcome], seed: int) -> int:
    mistakes = [mistake for outcome in outcomes for mistake in outcome.mistakes]
    print(f"{len(outcomes)} runs, seed {seed}")
    for name in dict.fromkeys(outcome.name for outcome in outcomes):
        own_outcomes = [outcome for outcome in outcomes if outcome.name == name]
        signal_count, write_count = (
            sum(getattr(outcome, field) for outcome in own_outcomes) for field in ("signals", "acknowledged")
        )
        print(f"  {name}: {len(own_outcomes)} runs, {signal_count} signals, {write_count} acknowledged")
    print(f"mistakes: {len(mistakes)}")
    for mistake in mistakes[:20]:
        print(f"  {mistake}")
    return 1 if mistakes else 0


if __name__ == "__main__":
    run_count, first_seed = (int(argument) for argument in sys.argv[1:3])
    sys.exit(main(run_count, first_seed, int(sys.argv[3]) if len(sys.argv) > 3 else 0))
