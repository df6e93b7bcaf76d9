"""Inspection of specs: compile and load a package, sweep its loops, and draw the results.

`sweep_pictures` and `fuzzy_pictures` need matplotlib (the extra `viz`). Import these two modules directly.
"""

from __future__ import annotations

from codra_dsl.integrations.inspection.loading import (
    CompiledSpec,
    SpecError,
    compile_and_load,
    load_package,
    read_spec,
    source_files,
)
from codra_dsl.integrations.inspection.sweeps import Subject, SweepError, held, subject, varied

__all__ = [
    "CompiledSpec",
    "SpecError",
    "Subject",
    "SweepError",
    "compile_and_load",
    "held",
    "load_package",
    "read_spec",
    "source_files",
    "subject",
    "varied",
]
