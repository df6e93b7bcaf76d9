"""A small experiment of a project's own: how many frames are rendered in four seconds?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from codra_papers.experiments.campaign.campaign import TRIALS
from codra_papers.experiments.campaign.document import Document, Photograph, Section, Table
from codra_papers.experiments.campaign.experiment import FIRST_REPORTED_SEED, Experiment, Settings
from codra_papers.experiments.lab.arms import NAIVE, NEED
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.lab.run import Loops
from codra_papers.experiments.lab.trials import Trial


def trials(settings: Settings) -> Sequence[Trial]:
    return [
        Trial(
            name=f"seed {seed}",
            spec=settings.spec,
            seed=seed,
            arms=(NEED, NAIVE),
            work=Loops(),
            duration_s=4.0,
            frames_kept=1,
        )
        for seed in range(FIRST_REPORTED_SEED, FIRST_REPORTED_SEED + settings.seeds)
    ]


def judge(settings: Settings, outcomes: Mapping[str, Outcome]) -> Document:
    frames = {name: outcome.frames for name, outcome in outcomes.items()}
    photographs = [
        Photograph(caption=f"{kept.algorithm} in {name}", path=settings.folder / TRIALS / name / kept.file)
        for name, outcome in outcomes.items()
        for kept in outcome.kept
    ]
    table = Table(caption="Frames rendered.", header=("trial", "frames"), rows=list(frames.items()))
    return Document(
        title="Frames",
        summary=[f"In {len(frames)} trials {sum(frames.values())} frames were rendered."],
        sections=[Section(title="Frames", parts=[table, *photographs])],
        results={"frames": frames},
    )


EXPERIMENT = Experiment(
    name="tiny", question="How many frames are rendered in four seconds?", seeds=2, trials=trials, judge=judge
)
