"""The experiments by name: those of this package, and those of a project's own modules."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping

import codra_dsl.experiments
from codra_dsl.experiments.experiment import Experiment

_CONSTANT = "EXPERIMENT"


class NoExperimentError(LookupError):
    """There is no such experiment; the message says why."""


def experiments() -> Mapping[str, Experiment]:
    """Return the experiments of this package by name, in order: whatever its modules call `EXPERIMENT`."""
    names = [module.name for module in pkgutil.iter_modules(codra_dsl.experiments.__path__)]
    modules = [importlib.import_module(f"{codra_dsl.experiments.__name__}.{name}") for name in sorted(names)]
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
