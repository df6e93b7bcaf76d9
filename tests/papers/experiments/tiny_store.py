"""A small experiment in the store: one cell of the grid on one seed, then all managers on another."""

from __future__ import annotations

from codra_papers.experiments.studies.store_managers import experiment
from codra_papers.experiments.studies.store_managers.search import Design
from codra_papers.experiments.studies.store_managers.thresholds import Thresholds

DESIGN = Design(
    grid=(Thresholds(distance_m=1.5, battery_percent=15.0, load="full"),),
    tuning_seeds=(1,),
    first_seed=2,
    duration_s=6.0,
)
EXPERIMENT = experiment(DESIGN, "tiny-store", 1)
