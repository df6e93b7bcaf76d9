"""Find the experiments of this package, and experiments in a project's own modules."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping

from codra_papers.experiments.campaign.experiment import Experiment

_STUDIES_PACKAGE = "codra_papers.experiments.studies"
_CONSTANT_NAME = "EXPERIMENT"


class NoExperimentError(LookupError):
    """An experiment cannot be imported, or is not an `Experiment`. The message gives the reason."""


def experiments() -> Mapping[str, Experiment]:
    """Return a mapping from the names of this package's experiments to the experiments.

    They are the constants `EXPERIMENT` of the modules of `studies`, in the order of the module names.
    """
    package = importlib.import_module(_STUDIES_PACKAGE)
    module_names = sorted(module.name for module in pkgutil.iter_modules(package.__path__))
    modules = [importlib.import_module(f"{_STUDIES_PACKAGE}.{name}") for name in module_names]
    package_experiments = [
        value for module in modules if isinstance(value := getattr(module, _CONSTANT_NAME, None), Experiment)
    ]
    return {experiment.name: experiment for experiment in package_experiments}


def experiment_in(reference: str) -> Experiment:
    """Return an experiment of a project.

    Args:
        reference: the module and the constant, as `module:CONSTANT`.

    Raises:
        NoExperimentError: if the constant cannot be imported or is not an `Experiment`.
    """
    module_name, _, constant_name = reference.partition(":")
    try:
        experiment = getattr(importlib.import_module(module_name), constant_name)
    except (ImportError, ValueError, AttributeError) as error:
        raise NoExperimentError(f"'{reference}' cannot be imported: {error}") from error
    if not isinstance(experiment, Experiment):
        raise NoExperimentError(f"'{reference}' is not an Experiment")
    return experiment
