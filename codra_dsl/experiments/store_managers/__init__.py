"""What the loops of the store are worth: four managers in the same shop."""

from __future__ import annotations

from codra_dsl.experiments.experiment import Experiment, World
from codra_dsl.experiments.store_managers.judgement import judge, reported_trials
from codra_dsl.experiments.store_managers.search import search_trials

EXPERIMENT = Experiment(
    name="store",
    question="What are the loops of the store worth against no adaptation, chance, and plain thresholds?",
    seeds=20,
    trials=search_trials,
    judge=judge,
    then=reported_trials,
    world=World.STORE,
)
"""A search for thresholds on the tuning seeds, and all managers on others."""
