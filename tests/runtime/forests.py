"""Forests from plain data, with the same nodes and structure as generated code."""

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
    """The handle `world`: the result of each algorithm (a value, or a function of its job), and its calls."""

    finds: dict[str, object] = field(default_factory=dict)
    calls: list[tuple[str, float]] = field(default_factory=list)
    given: list[Mapping[str, object]] = field(default_factory=list)

    def asked_s(self, algorithm: str) -> list[float]:
        return [at_s for name, at_s in self.calls if name == algorithm]


def look(*, algorithm: str, world: World, job: Any, **given: object) -> object:
    world.calls.append((algorithm, job.now_s()))
    world.given.append(given)
    result = world.finds[algorithm]
    return result(job) if callable(result) else result


def takes(duration_s: float, returns: object, *, snapshot: bool = False) -> Find:
    """Return a look that takes some time; with `snapshot`, the evidence is taken at the first instant of the look."""

    def find(job: Any) -> object:
        if snapshot:
            job.evidence(job.now_s(), job.now_s())
        result = returns() if callable(returns) else returns
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
    """One algorithm in a tree: its preconditions, its refinements, and the variables that it identifies."""

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
    """Return a look whose result `seen` is the value of each variable."""
    return Look(algorithm(name, **settings), dict.fromkeys(variables, value("seen")), when, accept)


def tree(*looks: Look) -> Callable[[Observer], Behaviour]:
    """Return a tree as in P1, Figure 4; several looks are alternatives, in the order of their rank."""

    def build(observer: Observer) -> Behaviour:
        children: list[Behaviour] = [ControlFlag(observer)]
        branches = [(look, observer.branch(look.algorithm)) for look in looks]
        branch_children = [[*look.start(branch), *look.rest(branch)] for look, branch in branches]
        if len(branch_children) == 1:
            children += branch_children[0]
        else:
            alternatives = [
                TreeSequence(look.algorithm.name, False, behaviours)
                for look, behaviours in zip(looks, branch_children, strict=True)
            ]
            children.append(Selector("alternatives", False, alternatives))
        return TreeSequence(observer.name, False, children)

    return build


def joined(when: Sequence[Term], *looks: Look) -> Callable[[Observer], Behaviour]:
    """Return trees of different algorithms under shared preconditions."""

    def build(observer: Observer) -> Behaviour:
        branches = [observer.branch(look.algorithm) for look in looks]
        shared = [Precondition(repr(term), term, *branches) for term in when]
        parts: list[Behaviour] = [
            FailureIsSuccess(look.algorithm.name, TreeSequence(look.algorithm.name, False, look.rest(branch)))
            for look, branch in zip(looks, branches, strict=True)
        ]
        together = Parallel("joined", ParallelPolicy.SuccessOnAll(synchronise=False), parts)
        return TreeSequence(observer.name, False, [ControlFlag(observer), *shared, together])

    return build


def observer(name: str, *looks: Look, joined_when: Sequence[Term] | None = None, **settings: Any) -> ObserverModel:
    build = tree(*looks) if joined_when is None else joined(joined_when, *looks)
    identifies = tuple(dict.fromkeys(variable for look in looks for variable in look.identifies))
    return ObserverModel(name=name, identifies=identifies, build=build, **settings)


def variable(name: str, **settings: Any) -> VariableModel:
    return VariableModel(name=name, **{"type": boolean(), **settings})


def given(name: str, **settings: Any) -> VariableModel:
    """Return a variable that the main execution writes."""
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
    """Return the `what` of the events of a kind."""
    return [event.what for event in manager.record.of(kind) if name in (None, event.name)]
