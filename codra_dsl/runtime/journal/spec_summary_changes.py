"""What two versions of a spec say otherwise, as far as it decides what happens in a run."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest

from codra_dsl.runtime.journal.spec_summary import AlgorithmOutline, Place, Rule, SpecSummary
from codra_dsl.runtime.values.model import ValueType


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """Something that a spec says otherwise now; None stands for what it does not say.

    Attributes:
        owner: what it is said of: a variable, algorithm, observer or skill.
        what: which of its settings it is, as a spec has it.
    """

    owner: str
    what: str
    before: Rule | None
    now: Rule | None

    def __str__(self) -> str:
        return f"{self.owner}, {self.what}: {_shown(self.now)}, where it ran with {_shown(self.before)}"


def _shown(said: Rule | None) -> str:
    if said is None:
        return "nothing"
    return said.text if said.place is None else f"{said.text} [{said.place}]"


def changes_near(names: Iterable[str], before: SpecSummary, now: SpecSummary) -> tuple[Change, ...]:
    """Return what two versions say otherwise, first what is nearest to some variables, algorithms or observers.

    Near is what it is identified by, then what that needs, and so on up the dependency graph.
    """
    found = tuple(changes(before, now))
    order = {owner: number for number, owner in enumerate(_upstream(names, before, now))}
    return tuple(sorted(found, key=lambda change: order.get(change.owner, len(order))))


def changes(before: SpecSummary, now: SpecSummary) -> Iterator[Change]:
    """Yield what two versions say otherwise."""
    old, new = _said(before), _said(now)
    for key in dict.fromkeys((*new, *old)):
        yield from _changed(*key, old.get(key, ()), new.get(key, ()))


def _changed(owner: str, what: str, old: Sequence[Rule], new: Sequence[Rule]) -> Iterator[Change]:
    meant, means = {rule.python for rule in old}, {rule.python for rule in new}
    gone = [rule for rule in old if rule.python not in means]
    come = [rule for rule in new if rule.python not in meant]
    for was, is_now in zip_longest(gone, come):
        yield Change(owner=owner, what=what, before=was, now=is_now)


def _said(summary: SpecSummary) -> Mapping[tuple[str, str], Sequence[Rule]]:
    """Return all that decides what happens, by what it is said of and which setting it is."""
    said: dict[tuple[str, str], Sequence[Rule]] = {}
    for algorithm in summary.algorithms.values():
        said |= {(algorithm.name, what): rules for what, rules in _said_of(algorithm).items()}
    for variable in summary.variables.values():
        place = summary.places.get(f"context/{variable.name}")
        said[variable.name, "type"] = _plain(_type(variable.type), place)
        said[variable.name, "source"] = _plain(" or ".join(variable.sources), place)
        said[variable.name, "valid_for"] = _plain(f"{variable.valid_for_s:g} s", place)
        said[variable.name, "when_unobservable"] = _plain(str(variable.when_unobservable), place)
    for observer in summary.observers.values():
        said[observer.name, "algorithms"] = _plain(", ".join(observer.algorithms), observer.place)
        said[observer.name, "period"] = _plain(f"{observer.period_s:g} s", observer.place)
    for skill in summary.skills.values():
        place = summary.places.get(f"skill/{skill.name}")
        said[skill.name, "preview"] = _plain(", ".join(map(str, skill.preview)), place)
        said[skill.name, "monitor"] = _plain(", ".join(map(str, skill.monitor)), place)
        said[skill.name, "changes"] = _plain(", ".join(map(str, skill.changes)), place)
    return said


def _said_of(algorithm: AlgorithmOutline) -> Mapping[str, Sequence[Rule]]:
    return {
        "observable_when": algorithm.conditions,
        "accept_when": algorithm.accepts,
        "timeout": _plain(f"{algorithm.timeout_s:g} s", algorithm.place),
        **{f"identifies {variable}": (rule,) for variable, rule in algorithm.identifies.items()},
        **{f"returns {name}": _plain(_type(kind), algorithm.place) for name, kind in algorithm.returns.items()},
    }


def _plain(text: str, place: Place | None) -> Sequence[Rule]:
    return (Rule(python=text, said=text, place=place),)


def _type(declared: ValueType) -> str:
    ends = "" if declared.range is None else f" from {declared.range[0]:g} to {declared.range[1]:g}"
    unit, members = f" {declared.unit}" if declared.unit else "", ", ".join(declared.members)
    return f"{'optional ' if declared.optional else ''}{declared.kind}{unit}{ends}{members and f' of {members}'}"


def _upstream(names: Iterable[str], *outlines: SpecSummary) -> Sequence[str]:
    """Return what variables, algorithms or observers come from, the nearest first."""
    met = list(names)
    for each in met:
        met.extend(source for summary in outlines for source in _sources(each, summary) if source not in met)
    return met


def _sources(name: str, summary: SpecSummary) -> Iterator[str]:
    if name in summary.algorithms:
        rules = summary.algorithms[name].conditions
        yield from sorted({variable for rule in rules for variable in rule.term.variables()})
    if name in summary.observers:
        yield from summary.observers[name].algorithms
    observer = summary.observer_of(name)
    if observer is not None:
        yield from (algorithm.name for algorithm in summary.algorithms_of(name))
        yield observer.name
