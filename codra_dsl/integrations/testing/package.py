"""The compiled spec of a timeline: names and types for its checks, and the code that runs.

A timeline is checked against the compiled spec, not against the YAML file of the spec. So the timeline tests the code
that runs on the robot.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from codra_dsl.compiler import plan_paths
from codra_dsl.generation.emit.records import model_digest
from codra_dsl.isolation.error_text import described
from codra_dsl.language.diagnostics import suggest
from codra_dsl.runtime import ContextManager, ContextModel, SimClock
from codra_dsl.runtime.behavior_trees import Kind, Ports, sequence
from codra_dsl.runtime.context.package_files import manifest_of
from codra_dsl.runtime.knowledge import KnowledgeModel
from codra_dsl.runtime.loops import Mape, MapeModel
from codra_dsl.runtime.values.declarations import DERIVED, MAIN, OBSERVER, POSES
from codra_dsl.runtime.values.model import Algorithm, VariableModel

FOLDER = "generated"
_OWN_SOURCES = (MAIN, OBSERVER, DERIVED, POSES)
"""The sources that are not outside writers."""


class PackageError(Exception):
    """There is no compiled spec of this name that is up to date and can be imported.

    Attributes:
        message: the problem.
        help: how to fix it.
    """

    def __init__(self, message: str, help_text: str) -> None:
        super().__init__(f"{message}: {help_text}")
        self.message = message
        self.help = help_text


@dataclass(frozen=True, slots=True, kw_only=True)
class Package:
    """A compiled spec.

    Attributes:
        build: makes the context manager of the spec.
        algorithms: a mapping from names to the algorithms that the observers run.
        knowledge: the knowledge graph of the spec; None if the spec has none.
        mape: the MAPE-K loops of the spec; None if the spec has none.
        leaves: the names of the robot's leaves in the trees that the loops execute.
    """

    model: ContextModel
    build: Callable[..., ContextManager[Any, Any]]
    algorithms: Mapping[str, Algorithm]
    knowledge: KnowledgeModel | None = None
    mape: MapeModel | None = None
    leaves: tuple[str, ...] = ()

    @property
    def variables(self) -> Mapping[str, VariableModel]:
        """Return a mapping from names to context-variables."""
        return {variable.name: variable for variable in self.model.variables}

    @property
    def agents(self) -> tuple[str, ...]:
        """Return the names of outside writers of context-variables and of the knowledge graph, sorted."""
        sources = {source for variable in self.model.variables for source in variable.sources}
        if self.knowledge is not None:
            sources |= {writer.agent for node_type in self.knowledge.node_types for writer in node_type.sources}
            sources |= {writer.agent for edge_type in self.knowledge.edge_types for writer in edge_type.sources}
        return tuple(sorted(sources.difference(_OWN_SOURCES)))

    @property
    def handles(self) -> tuple[str, ...]:
        """Return the names of the resources that have handles."""
        return tuple(resource.name for resource in self.model.resources if resource.slots is None)


@cache
def load_package(root: Path, name: str, folder: str = FOLDER) -> Package:
    """Import a compiled spec as programs in the project's root do: `from generated import NAME`.

    This happens once per process. Before the import, the spec is compiled once more, to make sure that the package
    contains the model of the spec; the generated files are not compared.

    Args:
        root: the root of the project; Python searches modules there from now on.
        name: the name of the spec.
        folder: the name of the folder with the packages, in the root.

    Raises:
        PackageError: if there is no compiled spec of this name that is up to date and can be imported.
    """
    _require_compiled_spec(root, name, folder)
    _require_up_to_date(root, name, folder)
    if str(root) not in sys.path:
        sys.path.insert(0, str(root))
    try:
        module = importlib.import_module(f"{folder}.{name}")
    except Exception as error:
        message = f"'{folder}/{name}' cannot be imported: {described(error)}"
        raise PackageError(message, "compile it again: codra compile") from error
    if not Path(str(module.__file__)).resolve().is_relative_to(root.resolve()):
        message = f"Python finds '{folder}.{name}' in another project"
        raise PackageError(message, "run pytest for each project separately")
    return _package(module)


def _require_compiled_spec(root: Path, name: str, folder: str) -> None:
    compiled_names = sorted(manifest.parent.name for manifest in (root / folder).glob("*/manifest.json"))
    if name not in compiled_names:
        suggestion = suggest(name, compiled_names)
        help_text = f"did you mean '{suggestion}'?" if suggestion else "compile the spec first: codra compile"
        raise PackageError(f"there is no compiled spec '{folder}/{name}'", help_text)


def _require_up_to_date(root: Path, name: str, folder: str) -> None:
    """Require that the package was compiled from the model that the spec has now, if the spec and its site exist."""
    manifest = manifest_of(root / folder / name)
    files = [str(manifest[key]) for key in ("spec", "site") if key in manifest]
    if not files or not all((root / file).is_file() for file in files):
        return
    spec, *sites = files
    arguments = " ".join([spec, *(f"--site {site}" for site in sites)])
    plans = plan_paths([root / spec], root, sites=[root / site for site in sites]).plans
    if not plans:
        raise PackageError(f"'{spec}' has errors", f"see: codra lint {arguments}")
    if model_digest(plans[0]) != manifest.get("model"):
        message = f"'{folder}/{name}' is out of date: it does not match {' and '.join(map(repr, files))}"
        raise PackageError(message, f"compile it: codra compile {arguments}")


def _package(module: ModuleType) -> Package:
    """Return the compiled spec in a module. To collect the algorithms, the forest is built once; no tree is ticked."""
    model: ContextModel = module.MODEL
    classes = [
        member for member in vars(module).values() if isinstance(member, type) and issubclass(member, ContextManager)
    ]
    generated_class = next(manager_class for manager_class in classes if manager_class is not ContextManager)
    algorithms: dict[str, Algorithm] = {}

    def collect_algorithm(algorithm: Algorithm) -> Callable[..., object]:
        algorithms[algorithm.name] = algorithm
        return collect_algorithm

    handles = {resource.name: None for resource in model.resources if resource.slots is None}
    knowledge: KnowledgeModel | None = getattr(module, "KNOWLEDGE", None)
    mape: MapeModel | None = getattr(module, "MAPE", None)
    clock, robot = SimClock(), _LeafCollector()
    with generated_class(model, clock=clock, resources=handles, find=collect_algorithm, knowledge=knowledge) as codra:
        if mape is not None:
            Mape(codra, mape, clock=clock, robot=robot).close()
    return Package(
        model=model,
        build=generated_class,
        algorithms=algorithms,
        knowledge=knowledge,
        mape=mape,
        leaves=tuple(sorted(robot.names)),
    )


class _LeafCollector:
    """Collects the names of the leaves whose actions trees request; no action is ever started."""

    def __init__(self) -> None:
        self.names: set[str] = set()

    def of(self, name: str) -> None:
        """Note the name of a leaf."""
        self.names.add(name)

    def control(self, name: str, ports: Ports) -> Kind:  # noqa: ARG002 - the signature is that of `Leaves`
        """Return any kind, because no tree is ticked."""
        return sequence()
