"""Run eight threads on context managers at random: `python -m tests.campaigns.crowd OPERATIONS [SEED...]`."""

from __future__ import annotations

import sys

from tests.campaigns.crowd.crowd import THREADS, Crowd, Figures


def main(operations: int, seeds: list[int]) -> int:
    """Run a crowd for each seed; return 1 if a mistake was found."""
    figures_of_runs = [print_figures(seed, Crowd(seed, operations).run()) for seed in seeds]
    return 1 if any(figures.mistakes for figures in figures_of_runs) else 0


def print_figures(seed: int, figures: Figures) -> Figures:
    """Print the figures of a run."""
    operations = sum(number for what, number in figures.done.items() if what[0] != "(")
    print(f"seed {seed}: {operations} operations of {THREADS} threads, {figures.lives} lives, {figures.jobs} jobs")
    print("  " + ", ".join(f"{what} {number}" for what, number in sorted(figures.done.items())))
    print(
        f"  {figures.judged} pauses judged, {figures.most_declared} declared and {figures.most_running} running at most"
    )
    print(f"  longest wake-up in silence {figures.longest_wake_up_s * 1e3:.1f} ms")
    print(f"  mistakes: {len(figures.mistakes)}")
    for mistake in figures.mistakes[:5]:
        print(f"    {mistake}")
    return figures


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), [int(text) for text in sys.argv[2:]] or [1, 2, 3]))
