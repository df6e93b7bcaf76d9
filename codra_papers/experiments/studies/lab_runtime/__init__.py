"""P1, section 4.2: the time that the main execution saves with observers.

Each seed is run without and with observers. Looks have a random source of their own. So acting takes the same time in
both runs, and the runs differ only in perception.
"""

from __future__ import annotations

from codra_papers.experiments.campaign.experiment import Experiment
from codra_papers.experiments.studies.lab_runtime.judgement import judge
from codra_papers.experiments.studies.lab_runtime.runs import trials

EXPERIMENT = Experiment(
    name="lab-runtime",
    question="How much time does the main execution save with observers, and why (P1, section 4.2)?",
    seeds=20,
    quick_seeds=2,
    trials=trials,
    judge=judge,
)
"""The experiment runs P1's sample of five openings and five closings, further seeds, and a day of seven hours."""
