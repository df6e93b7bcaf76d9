"""A small experiment in the store: one cell of each search on one seed, then all managers on another."""

from __future__ import annotations

from codra_papers.experiments.studies.store_managers import experiment
from codra_papers.experiments.studies.store_managers.loop_parameters import LoopParameters
from codra_papers.experiments.studies.store_managers.managers import OURS_TUNED, THRESHOLD
from codra_papers.experiments.studies.store_managers.search import Design
from codra_papers.experiments.studies.store_managers.thresholds import Thresholds

DESIGN = Design(
    grids={
        THRESHOLD: (Thresholds(distance_m=1.5, battery_percent=15.0, load="full"),),
        OURS_TUNED: (LoopParameters(crowding_shift=0.2),),
    },
    tuning_seeds=(1,),
    first_seed=2,
    duration_s=6.0,
)
EXPERIMENT = experiment(DESIGN, "tiny-store", 1)
