"""Find experiments: the experiments of this package by name, and the experiments in a project's own modules."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping

from codra_papers.experiments.campaign.experiment import Experiment

_STUDIES = "codra_papers.experiments.studies"
_CONSTANT = "EXPERIMENT"


class NoExperimentError(LookupError):
    """An experiment cannot be imported, or is not an `Experiment`. The message gives the reason."""


def experiments() -> Mapping[str, Experiment]:
    """Return the experiments of this package by name: the constants `EXPERIMENT` of the modules of `studies`.

    Their order is that of the module names.
    """
    studies = importlib.import_module(_STUDIES)
    names = sorted(module.name for module in pkgutil.iter_modules(studies.__path__))
    modules = [importlib.import_module(f"{_STUDIES}.{name}") for name in names]
    known = [value for module in modules if isinstance(value := getattr(module, _CONSTANT, None), Experiment)]
    return {experiment.name: experiment for experiment in known}


def experiment_in(place: str) -> Experiment:
    """Return an experiment of a project.

    Args:
        place: where it is, as `module:CONSTANT`.

    Raises:
        NoExperimentError: if it cannot be imported or is not an `Experiment`.
    """
    module, _, constant = place.partition(":")
    try:
        constant_value = getattr(importlib.import_module(module), constant)
    except (ImportError, ValueError, AttributeError) as error:
        raise NoExperimentError(f"'{place}' cannot be imported: {error}") from error
    if not isinstance(constant_value, Experiment):
        raise NoExperimentError(f"'{place}' is not an Experiment")
    return constant_value
