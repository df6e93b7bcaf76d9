"""States that decide on context, for RAFCON, the engine of P1's main execution.

The semantic data of a state, under `codra`, declares how the state relates to context: the state is a skill, is the
acting part of a skill, expects skills, or looks for the value of a decision. A state that looks does not run if context
knows the value. Without a bridge, a state machine runs as before. The library `codra` has states to decide, expect and
set.

Annotations take effect around the method `run` of a state. So an existing state machine needs no other change, and the
declarations of a state are withdrawn even if the state aborts or is preempted. For the same reason, the library has no
states that begin or end a skill: the withdrawal must not depend on a transition.

This package needs only the core of RAFCON, without GTK and without a screen. RAFCON has a virtual environment of its
own on top of `.venv`, because its requirements include a GUI and pin old libraries.
"""

from __future__ import annotations

from codra_dsl.integrations.rafcon.annotations import AnnotationError
from codra_dsl.integrations.rafcon.bridge import Answers, Bridge
from codra_dsl.integrations.rafcon.engine import (
    LIBRARIES,
    Ended,
    MissingLibraryError,
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
    "MissingLibraryError",
    "entered",
    "opened",
    "register",
    "run_in_real_time",
    "run_in_simulated_time",
]
