"""The numbers that P1 reports in section 4.2: Table 3, Figure 8 and the day at the fair."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from codra_papers.experiments.studies.lab_runtime.executions import Task

EXECUTION_COUNT = 5
"""How often each task was executed without observers, and how often with observers."""

CHECK_COUNT = 4
"""The number of perception tasks in each execution: two for situation preview, two for situation monitoring."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperTask:
    """One task in P1, averaged over five executions.

    Attributes:
        preview_s: the time of the task's two previews, without and with observers (Table 3).
        monitoring_s: the time of the task's two monitored conditions, without and with observers (Table 3).
        perception_share: the share of the perception time that observers save (Figure 8).
        task_share: the share of the whole task's time that observers save (Figure 8).
        saved_per_check_s: the time saved per perception task, on average (section 4.2).
    """

    preview_s: tuple[float, float]
    monitoring_s: tuple[float, float]
    perception_share: float
    task_share: float
    saved_per_check_s: float


PAPER: Mapping[Task, PaperTask] = MappingProxyType(
    {
        Task.OPENING: PaperTask(
            preview_s=(37.01, 4.65),
            monitoring_s=(35.79, 4.86),
            perception_share=0.87,
            task_share=0.18,
            saved_per_check_s=15.8,
        ),
        Task.CLOSING: PaperTask(
            preview_s=(38.92, 4.41),
            monitoring_s=(37.27, 4.19),
            perception_share=0.89,
            task_share=0.24,
            saved_per_check_s=16.9,
        ),
    }
)

CONTEXT_CHECK_S = sum(task.preview_s[1] + task.monitoring_s[1] for task in PAPER.values()) / (2 * CHECK_COUNT)
"""The mean duration of a perception task with observers (Table 3): 2.26 s."""

DAY_S = 7 * 3600.0
DAY_CHECKS = 153
"""The number of perception tasks that context answered at the fair."""

DAY_SAVED_MIN = 41.0
DAY_SAVED_PER_CHECK_S = 16.0

DAY_NAIVE_WRONG_COUNT = 4
"""How often the naive observer was wrong about the centrifuge's lid at a decision of the day (section 4.1)."""
