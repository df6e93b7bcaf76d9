"""The experiments by name: those of this package, and those of a project's own modules."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping

from codra_papers.experiments.campaign.experiment import Experiment

_STUDIES = "codra_papers.experiments.studies"
_CONSTANT = "EXPERIMENT"


class NoExperimentError(LookupError):
    """There is no such experiment; the message says why."""


def experiments() -> Mapping[str, Experiment]:
    """Return the experiments of this package by name, in order: whatever its modules call `EXPERIMENT`."""
    studies = importlib.import_module(_STUDIES)
    names = sorted(module.name for module in pkgutil.iter_modules(studies.__path__))
    modules = [importlib.import_module(f"{_STUDIES}.{name}") for name in names]
    found = [each for module in modules if isinstance(each := getattr(module, _CONSTANT, None), Experiment)]
    return {each.name: each for each in found}


def experiment_in(place: str) -> Experiment:
    """Return an experiment of a project's own, by `module:CONSTANT`.

    Raises:
        NoExperimentError: if there is none.
    """
    module, _, constant = place.partition(":")
    try:
        found = getattr(importlib.import_module(module), constant)
    except (ImportError, ValueError, AttributeError) as error:
        raise NoExperimentError(f"'{place}' cannot be imported: {error}") from error
    if not isinstance(found, Experiment):
        raise NoExperimentError(f"'{place}' is no Experiment")
    return found
