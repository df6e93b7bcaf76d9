"""A whole spec, and what it keeps of templates and their uses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from codra_dsl.diagnostics import Place
from codra_dsl.model.elements import Algorithm, ObserverSetting, Reference, Resource, Skill, Variable
from codra_dsl.model.knowledge import Agent, EdgeType, NodeElement, NodeType, Task
from codra_dsl.model.mape import Adaptation, Loop, Output, TreeElement


@dataclass(frozen=True, slots=True, kw_only=True)
class Use:
    """One use of a template."""

    instance: str
    template: str
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class DeclaredTemplate:
    """A template as declared, whether or not a `use` names it.

    Attributes:
        is_used: whether a `use` names it; also where some uses could not be read, so that nobody knows.
        parameters: those that it declares; a reference's name is the parameter's.
        resources: the names under `uses` of its algorithms, as written, parameters and all.
        sources: the names under `source` of its context-variables, likewise.
    """

    name: str
    place: Place
    is_used: bool
    parameters: tuple[Reference, ...] = ()
    resources: tuple[str, ...] = ()
    sources: tuple[str, ...] = ()


class AnyName(frozenset[str]):
    """Every name there is; iterating gives only those that are spelled out somewhere."""

    __slots__ = ()

    def __bool__(self) -> bool:
        """Return True: some names are damaged, even where none is spelled out."""
        return True

    def __contains__(self, name: object) -> bool:
        """Return True: whatever the name, it may belong to what could not be read."""
        return isinstance(name, str)


@dataclass(frozen=True, slots=True, kw_only=True)
class Spec:
    """A whole spec: one name, its parts included, its templates used.

    Attributes:
        file: of the spec itself, relative to the project root.
        files: all files that belong to it, the spec's own first, then parts in the order of inclusion.
        modules: the files of Python modules that its calls were compared with, or looked for in vain.
        origins: for each element (`kind`, `name`) the module it goes to: the instance of the use that made it, or
            the stem of the file it stands in; made an identifier and unique without regard to case.
        damaged: names per kind (`context`, `perception`, ...) of elements that `load` could not read whole, be they
            kept or left out; `AnyName` where a part or a use could not be read, since nobody knows which names it would
            have made. Under `spec` it has the spec's own name where `load` found any error, so that no spec with an
            error is ever planned.
        damaged_keys: for each damaged element (`kind`, `name`) that is kept, which of its keys could not be read and
            have their default; one entry of `returns` or `identifies` is listed as `returns.NAME`.
    """

    name: str
    place: Place
    file: str
    files: tuple[str, ...]
    modules: tuple[str, ...] = ()
    context: tuple[Variable, ...] = ()
    perception: tuple[Algorithm, ...] = ()
    skills: tuple[Skill, ...] = ()
    observers: tuple[ObserverSetting, ...] = ()
    resources: tuple[Resource, ...] = ()
    agents: tuple[Agent, ...] = ()
    types: tuple[NodeType, ...] = ()
    nodes: tuple[NodeElement, ...] = ()
    edges: tuple[EdgeType, ...] = ()
    tasks: tuple[Task, ...] = ()
    metrics: tuple[Output, ...] = ()
    actions: tuple[Output, ...] = ()
    adaptation: tuple[Adaptation, ...] = ()
    trees: tuple[TreeElement, ...] = ()
    loops: tuple[Loop, ...] = ()
    uses: tuple[Use, ...] = ()
    templates: tuple[DeclaredTemplate, ...] = ()
    origins: Mapping[tuple[str, str], str] = field(default_factory=dict, compare=False, hash=False)
    damaged: Mapping[str, frozenset[str]] = field(default_factory=dict, compare=False, hash=False)
    damaged_keys: Mapping[tuple[str, str], frozenset[str]] = field(default_factory=dict, compare=False, hash=False)

    @property
    def adapts(self) -> bool:
        """Whether it says anything of MAPE-K loops."""
        rates = any(each.rate is not None for each in self.context)
        return bool(self.metrics or self.actions or self.adaptation or self.trees or self.loops or rates)

    @property
    def knows(self) -> bool:
        """Whether it says anything of knowledge: then its context-variables are attributes of nodes."""
        return bool(
            self.types
            or self.nodes
            or self.edges
            or self.tasks
            or any(not each.conduct.is_bare for each in self.agents)
        )
