"""The value of the loops of the store: six managers in the same shop."""

from __future__ import annotations

from functools import partial

from codra_papers.experiments.campaign.experiment import Experiment, World
from codra_papers.experiments.studies.store_managers.judgement import judge, reported_trials
from codra_papers.experiments.studies.store_managers.search import Design, search_trials


def experiment(design: Design, name: str, seeds: int) -> Experiment:
    """Return the experiment of a design.

    The experiment searches for thresholds and for numbers of the loops on some seeds, and then runs all managers on
    other seeds.
    """
    return Experiment(
        name=name,
        question="What do the loops of the store bring that a speed rule or tuned thresholds do not?",
        seeds=seeds,
        trials=partial(search_trials, design),
        judge=partial(judge, design),
        then=partial(reported_trials, design),
        world=World.STORE,
    )


EXPERIMENT = experiment(Design(), "store", 20)
"""The experiment of the protocol (docs/papers/store-experiment.md)."""
