"""A complete spec, with its templates and their uses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field

from codra_dsl.language.diagnostics import Place
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model.elements import (
    Algorithm,
    ObserverSetting,
    PoseCondition,
    Reference,
    Resource,
    Skill,
    Variable,
)
from codra_dsl.language.model.knowledge import Agent, EdgeType, NodeElement, NodeType, Task
from codra_dsl.language.model.mape import Adaptation, Loop, Output, TreeElement
from codra_dsl.language.model.site import Replacement, Site


@dataclass(frozen=True, slots=True, kw_only=True)
class Use:
    """One use of a template.

    Attributes:
        place: the place of the name of the use.
        template_place: the place of the template's name in the use.
        arguments: references to the parameters for which the use gives values.
    """

    instance: str
    template: str
    place: Place
    template_place: Place
    arguments: tuple[Reference, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class DeclaredParameter:
    """A parameter of a template.

    Attributes:
        type: the type as written.
        default: the default as written; None if every use must give a value.
        mentions: the places of `$(NAME)` in the template.
    """

    name: str
    type: str
    default: str | None
    place: Place
    mentions: tuple[Place, ...]

    @property
    def summary(self) -> str:
        """The type, and the default if there is one."""
        return self.type if self.default is None else f"{self.type}, {self.default} by default"


@dataclass(frozen=True, slots=True, kw_only=True)
class DeclaredTemplate:
    """A template as declared, whether or not a `use` names it.

    Attributes:
        is_used: whether a `use` names the template, or may name it because some uses could not be read.
        resources: the names under `uses` of its algorithms, as written; they may contain parameters.
        sources: the names of the writers of its elements (`source`), and of the participants in its tasks (`by`,
            `requesters`), as written; they may contain parameters.
    """

    name: str
    place: Place
    is_used: bool
    parameters: tuple[DeclaredParameter, ...] = ()
    resources: tuple[str, ...] = ()
    sources: tuple[str, ...] = ()


class AnyName(frozenset[str]):
    """The set of all names; iterating yields only the names that were read."""

    __slots__ = ()

    def __bool__(self) -> bool:
        """Return True: some names are damaged, even if none of them could be read."""
        return True

    def __contains__(self, name: object) -> bool:
        """Return True for any name: it may belong to a part that could not be read."""
        return isinstance(name, str)


@dataclass(frozen=True, slots=True, kw_only=True)
class Spec:
    """A complete spec: one name, with its parts included and its templates instantiated.

    Attributes:
        file: the spec's own file, relative to the project root.
        files: all files of the spec: its own file first, then parts in the order of inclusion.
        site: the values that a site's file states; None without a site. The last of `files` is the site's file.
        modules: the files with which its calls and topics were compared: Python modules and definitions of messages,
            including files that do not exist.
        origins: for each element (`kind`, `name`), the name of its generated module. A module is named after the `use`
            that made the element, or after the element's file. The name is an identifier, unique without regard to
            case.
        damaged: for each kind (`context`, `perception`, ...), the names of the elements that `load` could not read
            completely, whether it kept these elements or left them out. If a part or a use could not be read, names are
            unknown; the value is then `AnyName`. The kind `spec` has the spec's own name if `load` reported any error,
            so that a spec with an error is never planned.
        damaged_keys: for each damaged element (`kind`, `name`) that is kept, the keys that could not be read and
            therefore have their default. Entries of `returns`, `identifies`, `attributes` and `rules` are listed one by
            one, such as `returns.NAME`.
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
    site: Site | None = None
    origins: Mapping[tuple[str, str], str] = field(default_factory=dict, compare=False, hash=False)
    damaged: Mapping[str, frozenset[str]] = field(default_factory=dict, compare=False, hash=False)
    damaged_keys: Mapping[tuple[str, str], frozenset[str]] = field(default_factory=dict, compare=False, hash=False)

    @property
    def adapts(self) -> bool:
        """Whether the spec declares any element of MAPE-K loops."""
        has_rates = any(variable.rate is not None for variable in self.context)
        return bool(self.metrics or self.actions or self.adaptation or self.trees or self.loops or has_rates)

    @property
    def pose_conditions(self) -> tuple[PoseCondition, ...]:
        """The comparisons with poses in the spec's conditions."""
        return tuple(variable.pose_condition for variable in self.context if variable.pose_condition is not None)

    def site_arguments(self, place: Place) -> Sequence[Replacement]:
        """Return the arguments of the site that are in a value at a place; if none is, all arguments of its use."""
        replacements = () if self.site is None else self.site.replacements_of.get(place.use, ())
        arguments = [value for value in replacements if value.section == "use"]
        template_name = next((use.template for use in self.uses if use.place.span == place.use), None)
        mentioned_names = {
            parameter.name
            for template in self.templates
            if template.name == template_name
            for parameter in template.parameters
            if any(place.span.contains(mention.span) for mention in parameter.mentions)
        }
        return [value for value in arguments if value.key in mentioned_names] or arguments

    @property
    def knows(self) -> bool:
        """Whether the spec declares knowledge. If so, its context-variables are attributes of nodes."""
        return bool(
            self.types
            or self.nodes
            or self.edges
            or self.tasks
            or any(not agent.conduct.is_bare for agent in self.agents)
        )
