"""Forests from plain data, built with the same nodes and in the same shape as generated code."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import ParallelPolicy
from py_trees.composites import Parallel, Selector
from py_trees.composites import Sequence as TreeSequence
from py_trees.decorators import FailureIsSuccess

from codra_dsl.logic import Term
from codra_dsl.runtime import ContextManager, ContextModel, SimClock
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.journal import Kind
from codra_dsl.runtime.observers.behaviours import Accept, ControlFlag, DueOrRunning, Identify, Perceive, Precondition
from codra_dsl.runtime.observers.observer import Branch, Observer, ObserverModel
from codra_dsl.runtime.values.conditions import value
from codra_dsl.runtime.values.model import Algorithm, ResourceModel, SkillModel, ValueType, VariableModel, boolean

Find = Callable[[Any], object]


@dataclass
class World:
    """The handle `world`: what each algorithm finds (a value, or a function of its job), and when it was asked."""

    finds: dict[str, object] = field(default_factory=dict)
    calls: list[tuple[str, float]] = field(default_factory=list)
    given: list[Mapping[str, object]] = field(default_factory=list)

    def asked_s(self, algorithm: str) -> list[float]:
        return [at_s for name, at_s in self.calls if name == algorithm]


def look(*, algorithm: str, world: World, job: Any, **given: object) -> object:
    world.calls.append((algorithm, job.now_s()))
    world.given.append(given)
    found = world.finds[algorithm]
    return found(job) if callable(found) else found


def takes(duration_s: float, found: object, *, snapshot: bool = False) -> Find:
    """What a look finds that takes some time; with `snapshot` its evidence is taken in its first instant."""

    def find(job: Any) -> object:
        if snapshot:
            job.evidence(job.now_s(), job.now_s())
        result = found() if callable(found) else found
        job.sleep(duration_s)
        return result

    return find


def algorithm(name: str, returns: Mapping[str, ValueType] | None = None, **settings: Any) -> Algorithm:
    return Algorithm(
        name=name,
        call="tests.runtime.forests:look",
        parameters={"algorithm": name},
        handles=("world",),
        returns={"seen": boolean(optional=True)} if returns is None else returns,
        **settings,
    )


@dataclass(frozen=True)
class Look:
    """One algorithm in a tree: when it can be trusted, what refines its result, and what that tells."""

    algorithm: Algorithm
    identifies: Mapping[str, Term]
    when: Sequence[Term] = ()
    accept: Sequence[Term] = ()

    def start(self, branch: Branch) -> list[Behaviour]:
        return [Precondition(repr(term), term, branch) for term in self.when]

    def rest(self, branch: Branch) -> list[Behaviour]:
        return [
            DueOrRunning(branch),
            Perceive(branch),
            *(Accept(repr(term), term, branch) for term in self.accept),
            *(Identify(variable, term, branch) for variable, term in self.identifies.items()),
        ]


def seen(name: str, *variables: str, when: Sequence[Term] = (), accept: Sequence[Term] = (), **settings: Any) -> Look:
    """A look whose result `seen` is the value of each variable."""
    return Look(algorithm(name, **settings), dict.fromkeys(variables, value("seen")), when, accept)


def tree(*looks: Look) -> Callable[[Observer], Behaviour]:
    """P1, Figure 4; with several looks they are alternatives, by rank."""

    def build(observer: Observer) -> Behaviour:
        children: list[Behaviour] = [ControlFlag(observer)]
        branches = [(each, observer.branch(each.algorithm)) for each in looks]
        parts = [[*each.start(branch), *each.rest(branch)] for each, branch in branches]
        if len(parts) == 1:
            children += parts[0]
        else:
            ways = [TreeSequence(look.algorithm.name, False, part) for look, part in zip(looks, parts, strict=True)]
            children.append(Selector("alternatives", False, ways))
        return TreeSequence(observer.name, False, children)

    return build


def joined(when: Sequence[Term], *looks: Look) -> Callable[[Observer], Behaviour]:
    """Trees of different algorithms under shared preconditions."""

    def build(observer: Observer) -> Behaviour:
        branches = [observer.branch(each.algorithm) for each in looks]
        shared = [Precondition(repr(term), term, *branches) for term in when]
        ways: list[Behaviour] = [
            FailureIsSuccess(each.algorithm.name, TreeSequence(each.algorithm.name, False, each.rest(branch)))
            for each, branch in zip(looks, branches, strict=True)
        ]
        together = Parallel("joined", ParallelPolicy.SuccessOnAll(synchronise=False), ways)
        return TreeSequence(observer.name, False, [ControlFlag(observer), *shared, together])

    return build


def observer(name: str, *looks: Look, joined_when: Sequence[Term] | None = None, **settings: Any) -> ObserverModel:
    build = tree(*looks) if joined_when is None else joined(joined_when, *looks)
    identifies = tuple(dict.fromkeys(variable for each in looks for variable in each.identifies))
    return ObserverModel(name=name, identifies=identifies, build=build, **settings)


def variable(name: str, **settings: Any) -> VariableModel:
    return VariableModel(name=name, **{"type": boolean(), **settings})


def given(name: str, **settings: Any) -> VariableModel:
    """A variable that the main execution writes."""
    return variable(name, sources=("main_execution",), **settings)


def forest(
    variables: Sequence[VariableModel],
    *observers: ObserverModel,
    skills: Sequence[SkillModel] = (),
    slots: Mapping[str, int | None] | None = None,
) -> ContextModel:
    resources = [ResourceModel(name=name, slots=count) for name, count in (slots or {}).items()]
    return ContextModel(
        name="test",
        variables=tuple(variables),
        observers=observers,
        skills=tuple(skills),
        resources=(ResourceModel(name="world"), *resources),
    )


Manager = ContextManager[str, str]


@contextmanager
def started(model: ContextModel, world: World, clock: Clock | None = None, seed: int = 0) -> Iterator[Manager]:
    clock = SimClock() if clock is None else clock
    with ContextManager[str, str](model, clock=clock, resources={"world": world}, seed=seed) as manager:
        yield manager


def events(manager: Manager, kind: Kind, name: str | None = None) -> list[str]:
    """What happened, without the rest."""
    return [event.what for event in manager.record.of(kind) if name in (None, event.name)]
