"""The value of the loops of the store: six managers in the same shop."""

from __future__ import annotations

from dataclasses import replace

from codra_papers.experiments.campaign.experiment import Experiment, Settings, World
from codra_papers.experiments.studies.store_managers.judgement import judge, reported_trials
from codra_papers.experiments.studies.store_managers.search import Design, search_trials

QUICK_DURATION_S = 900.0
"""The duration of the runs of a quick report."""


def experiment(design: Design, name: str, seeds: int) -> Experiment:
    """Return the experiment of a design.

    The experiment searches for thresholds and for numbers of the loops on some seeds, and then runs all managers on
    other seeds.
    """
    return Experiment(
        name=name,
        question="What do the loops of the store bring that a speed rule or tuned thresholds do not?",
        seeds=seeds,
        trials=lambda settings: search_trials(_sized(design, settings), settings),
        judge=lambda settings, outcomes: judge(_sized(design, settings), settings, outcomes),
        then=lambda settings, outcomes: reported_trials(_sized(design, settings), settings, outcomes),
        world=World.STORE,
        quick_seeds=1,
    )


def _sized(design: Design, settings: Settings) -> Design:
    """Return a design for a complete or a quick report. A quick report has shorter runs, and searches nothing."""
    if not settings.is_quick:
        return design
    return replace(
        design,
        grids={manager: grid[:1] for manager, grid in design.grids.items()},
        tuning_seeds=design.tuning_seeds[:1],
        duration_s=design.duration_s or QUICK_DURATION_S,
    )


EXPERIMENT = experiment(Design(), "store", 20)
"""The experiment of the protocol (docs/papers/store-experiment.md)."""
