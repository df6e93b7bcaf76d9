"""What two versions of a spec say otherwise, as far as it decides what happens in a run."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest

from codra_dsl.runtime.model import ValueType
from codra_dsl.runtime.outline import AlgorithmOutline, Outline, Place, Rule


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """Something that a spec says otherwise now; None stands for what it does not say.

    Attributes:
        owner: what it is said of: a variable, algorithm, observer or skill.
        what: which of its settings it is, as a spec has it.
    """

    owner: str
    what: str
    before: Rule | str | None
    now: Rule | str | None

    @property
    def place(self) -> Place | None:
        """Return where it stands now, or stood."""
        return next((each.place for each in (self.now, self.before) if isinstance(each, Rule) and each.place), None)

    def __str__(self) -> str:
        return f"{self.owner}, {self.what}: {_shown(self.now)}, where it ran with {_shown(self.before)}"


def _shown(said: Rule | str | None) -> str:
    if not isinstance(said, Rule):
        return said or "nothing"
    return said.text if said.place is None else f"{said.text} [{said.place}]"


def changes_near(names: Iterable[str], before: Outline, now: Outline) -> tuple[Change, ...]:
    """Return what two versions say otherwise, first what is nearest to some variables, algorithms or observers.

    Near is what it is identified by, then what that needs, and so on up the dependency graph.
    """
    found = tuple(changes(before, now))
    order = {owner: number for number, owner in enumerate(_upstream(names, before, now))}
    return tuple(sorted(found, key=lambda change: order.get(change.owner, len(order))))


def changes(before: Outline, now: Outline) -> Iterator[Change]:
    """Yield what two versions say otherwise."""
    old, new = _said(before), _said(now)
    for key in dict.fromkeys((*new, *old)):
        yield from _changed(*key, old.get(key, ()), new.get(key, ()))


def _changed(owner: str, what: str, old: Sequence[Rule | str], new: Sequence[Rule | str]) -> Iterator[Change]:
    gone = [each for each in old if _meaning(each) not in map(_meaning, new)]
    come = [each for each in new if _meaning(each) not in map(_meaning, old)]
    for was, is_now in zip_longest(gone, come):
        yield Change(owner=owner, what=what, before=was, now=is_now)


def _meaning(said: Rule | str) -> str:
    return said.python if isinstance(said, Rule) else said


def _said(outline: Outline) -> Mapping[tuple[str, str], Sequence[Rule | str]]:
    """Return all that decides what happens, by what it is said of and which setting it is."""
    said: dict[tuple[str, str], Sequence[Rule | str]] = {}
    for algorithm in outline.algorithms.values():
        said |= {(algorithm.name, what): rules for what, rules in _said_of(algorithm).items()}
    for variable in outline.variables.values():
        said[variable.name, "type"] = (_type(variable.type),)
        said[variable.name, "source"] = (" or ".join(variable.sources),)
        said[variable.name, "valid_for"] = (f"{variable.valid_for_s:g} s",)
        said[variable.name, "when_unobservable"] = (str(variable.when_unobservable),)
    for observer in outline.observers.values():
        said[observer.name, "algorithms"] = (", ".join(observer.algorithms),)
        said[observer.name, "period"] = (f"{observer.period_s:g} s",)
    for skill in outline.skills.values():
        for what in ("preview", "monitor", "changes"):
            said[skill.name, what] = tuple(map(str, getattr(skill, what)))
    return said


def _type(declared: ValueType) -> str:
    ends = "" if declared.range is None else f" from {declared.range[0]:g} to {declared.range[1]:g}"
    unit, members = f" {declared.unit}" if declared.unit else "", ", ".join(declared.members)
    return f"{'optional ' if declared.optional else ''}{declared.kind}{unit}{ends}{members and f' of {members}'}"


def _said_of(algorithm: AlgorithmOutline) -> Mapping[str, Sequence[Rule | str]]:
    return {
        "observable_when": algorithm.conditions,
        "accept_when": algorithm.accepts,
        "timeout": (f"{algorithm.timeout_s:g} s",),
        **{f"identifies {variable}": (rule,) for variable, rule in algorithm.identifies.items()},
        **{f"returns {name}": (_type(declared),) for name, declared in algorithm.returns.items()},
    }


def _upstream(names: Iterable[str], *outlines: Outline) -> Sequence[str]:
    """Return what variables, algorithms or observers come from, the nearest first."""
    met = list(names)
    for each in met:
        met.extend(source for outline in outlines for source in _sources(each, outline) if source not in met)
    return met


def _sources(name: str, outline: Outline) -> Iterator[str]:
    if name in outline.algorithms:
        rules = outline.algorithms[name].conditions
        yield from sorted({variable for rule in rules for variable in rule.term.variables()})
    if name in outline.observers:
        yield from outline.observers[name].algorithms
    observer = outline.observer_of(name)
    if observer is not None:
        yield from (algorithm.name for algorithm in outline.algorithms_of(name))
        yield observer.name
