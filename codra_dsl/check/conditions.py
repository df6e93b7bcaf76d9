"""Every condition of a spec: where it stands, what it may see, what it is, and its Python text."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

from codra_dsl.check.lowering import lower
from codra_dsl.check.types import Problem, Type, Typed, Types, fit, infer, infer_condition
from codra_dsl.expression import Call, Name, Node, walk
from codra_dsl.model import Algorithm, Condition, Hysteresis, Identification, Members, Spec


class Role(StrEnum):
    """What a condition is for; spelled as the key under which it stands."""

    OBSERVABLE_WHEN = "observable_when"
    ACCEPT_WHEN = "accept_when"
    IDENTIFIES = "identifies"
    MONITOR = "monitor"


class Result(StrEnum):
    """What a condition gives: true or false, or the value of a context-variable."""

    TRUTH = "truth"
    VALUE = "value"


@dataclass(frozen=True, slots=True, kw_only=True)
class Site:
    """A condition where it stands.

    Attributes:
        owner: the section and the name of the element that it belongs to.
        names: every mention of a name in it.
        values: the names whose value it reads: all but those of which it asks `known(x)` or `age(x)`.
        variable: the context-variable that gets its value or is expected to fulfil it.
    """

    role: Role
    owner: tuple[str, str]
    condition: Condition
    names: tuple[Name, ...]
    values: tuple[Name, ...]
    variable: str | None = None
    result: Result = Result.TRUTH

    @property
    def path(self) -> str:
        """Return the path of the key that it stands under."""
        return ".".join((*self.owner, self.role))


@dataclass(frozen=True, slots=True)
class Judgement:
    """A condition's types and what is wrong with them."""

    site: Site
    typed: Typed
    problems: tuple[Problem, ...]

    def python(self, wanted: Type | None) -> str:
        """Return the condition as Python text, a number in the unit of what it is given to."""
        return lower(self.typed, wanted.unit) if wanted is not None and wanted.numeric else lower(self.typed)


def sites(spec: Spec) -> Iterator[Site]:
    """Yield every condition of a spec that could be read."""
    for algorithm in spec.perception:
        yield from _algorithm_sites(algorithm)
    for skill in spec.skills:
        for expectation in skill.monitor:
            if expectation.condition is not None:
                owner = ("skills", skill.name)
                yield from _site(Role.MONITOR, owner, expectation.condition, expectation.variable.name)


def _algorithm_sites(algorithm: Algorithm) -> Iterator[Site]:
    owner = ("perception", algorithm.name)
    for condition in algorithm.observable_when:
        yield from _site(Role.OBSERVABLE_WHEN, owner, condition)
    for condition in algorithm.accept_when:
        yield from _site(Role.ACCEPT_WHEN, owner, condition)
    for entry in algorithm.identifies:
        result = Result.VALUE if isinstance(entry.by, Condition) else Result.TRUTH
        for condition in parts_of(entry):
            yield from _site(Role.IDENTIFIES, owner, condition, entry.variable.name, result)


def _site(
    role: Role,
    owner: tuple[str, str],
    condition: Condition,
    variable: str | None = None,
    result: Result = Result.TRUTH,
) -> Iterator[Site]:
    if condition.tree is None:
        return
    names, values = _mentions(condition.tree)
    yield Site(
        role=role, owner=owner, condition=condition, names=names, values=values, variable=variable, result=result
    )


def _mentions(tree: Node) -> tuple[tuple[Name, ...], tuple[Name, ...]]:
    """Return all mentions of names, and those by which a value is read."""
    if isinstance(tree, Name):  # as in most preconditions
        return (tree,), (tree,)
    parts = tuple(walk(tree))
    calls = (part for part in parts if isinstance(part, Call) and part.function in ("known", "age"))
    asked = {id(call.arguments[0]) for call in calls}
    names = tuple(part for part in parts if isinstance(part, Name))
    return names, tuple(name for name in names if id(name) not in asked) if asked else names


def parts_of(entry: Identification) -> tuple[Condition, ...]:
    """Return the conditions from which a variable's value follows."""
    if isinstance(entry.by, Members):
        return tuple(condition for _, condition in entry.by.cases)
    if isinstance(entry.by, Hysteresis):
        return (entry.by.enter,) if entry.by.leave is None else (entry.by.enter, entry.by.leave)
    return (entry.by,)


def judge(site: Site, tree: Node, seen: Types, wanted: Type | None) -> Judgement:
    """Return what a condition is and what is wrong with it.

    Args:
        site: the condition.
        tree: its syntax tree.
        seen: the types of the names that it can see.
        wanted: the type of the context-variable that gets its value, if one does.
    """
    known = site.role is Role.OBSERVABLE_WHEN
    if site.result is Result.TRUTH:
        return Judgement(site, *infer_condition(tree, seen, known=known))
    typed, problems = infer(tree, seen, known=known)
    misfits = () if problems or wanted is None else tuple(fit(typed, wanted, site.variable or ""))
    return Judgement(site, typed, problems + misfits)
