"""RAFCON, the engine of P1's main execution: states that decide on context.

A state says what it has to do with context in its semantic data, under `codra`: that it is a skill, that it acts, what
it expects next, or that it looks for what a decision needs and so need not run when context knows. A state machine
that is run without a bridge does what it always did. The library `codra` has states to decide, expect and set.

Of RAFCON it needs the core alone: neither GTK nor a screen.
"""

from __future__ import annotations

from codra_dsl.integrations.rafcon.annotations import AnnotationError
from codra_dsl.integrations.rafcon.bridge import Answers, Bridge
from codra_dsl.integrations.rafcon.engine import (
    LIBRARIES,
    Ended,
    entered,
    opened,
    register,
    run_in_real_time,
    run_in_simulated_time,
)

__all__ = [
    "LIBRARIES",
    "AnnotationError",
    "Answers",
    "Bridge",
    "Ended",
    "entered",
    "opened",
    "register",
    "run_in_real_time",
    "run_in_simulated_time",
]
