"""The differences between two versions of a spec that can change what happens in a run."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest

from codra_dsl.runtime.journal.spec_summary import AlgorithmSummary, Place, Rule, SpecSummary
from codra_dsl.runtime.values.model import ValueType


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """A setting that differs between the spec of a run and the present spec.

    Attributes:
        owner: the variable, algorithm, observer or skill that has the setting.
        what: the setting, named as in a spec.
        before: the setting in the spec of the run; None if that spec does not have it.
        now: the setting in the present spec; None if that spec does not have it.
    """

    owner: str
    what: str
    before: Rule | None
    now: Rule | None

    def __str__(self) -> str:
        return f"{self.owner}, {self.what}: {_shown(self.now)}; the run had {_shown(self.before)}"


def _shown(rule: Rule | None) -> str:
    if rule is None:
        return "none"
    return rule.text if rule.place is None else f"{rule.text} [{rule.place}]"


def changes_near(names: Iterable[str], before: SpecSummary, now: SpecSummary) -> tuple[Change, ...]:
    """Return the differences between two versions; those nearest to some variables, algorithms or observers come first.

    The nearest are those of the algorithms that identify a variable, then those of the variables that these algorithms
    need, and so on up the dependency graph.
    """
    order = {owner: number for number, owner in enumerate(_upstream(names, before, now))}
    return tuple(sorted(changes(before, now), key=lambda change: order.get(change.owner, len(order))))


def changes(before: SpecSummary, now: SpecSummary) -> Iterator[Change]:
    """Yield the differences between two versions."""
    old, new = _settings(before), _settings(now)
    for key in dict.fromkeys((*new, *old)):
        yield from _changed(*key, old.get(key, ()), new.get(key, ()))


def _changed(owner: str, what: str, old: Sequence[Rule], new: Sequence[Rule]) -> Iterator[Change]:
    old_texts, new_texts = {rule.python for rule in old}, {rule.python for rule in new}
    removed = [rule for rule in old if rule.python not in new_texts]
    added = [rule for rule in new if rule.python not in old_texts]
    for was, is_now in zip_longest(removed, added):
        yield Change(owner=owner, what=what, before=was, now=is_now)


def _settings(summary: SpecSummary) -> Mapping[tuple[str, str], Sequence[Rule]]:
    """Return all settings that decide what happens in a run, by owner and setting."""
    settings: dict[tuple[str, str], Sequence[Rule]] = {}
    for algorithm in summary.algorithms.values():
        settings |= {(algorithm.name, what): rules for what, rules in _algorithm_settings(algorithm).items()}
    for variable in summary.variables.values():
        place = summary.places.get(f"context/{variable.name}")
        settings[variable.name, "type"] = _plain(_type(variable.type), place)
        settings[variable.name, "source"] = _plain(" or ".join(variable.sources), place)
        settings[variable.name, "valid_for"] = _plain(f"{variable.valid_for_s:g} s", place)
        settings[variable.name, "when_unobservable"] = _plain(str(variable.when_unobservable), place)
    for observer in summary.observers.values():
        settings[observer.name, "algorithms"] = _plain(", ".join(observer.algorithms), observer.place)
        settings[observer.name, "period"] = _plain(f"{observer.period_s:g} s", observer.place)
    for skill in summary.skills.values():
        place = summary.places.get(f"skill/{skill.name}")
        settings[skill.name, "preview"] = _plain(", ".join(map(str, skill.preview)), place)
        settings[skill.name, "monitor"] = _plain(", ".join(map(str, skill.monitor)), place)
        settings[skill.name, "changes"] = _plain(", ".join(map(str, skill.changes)), place)
    return settings


def _algorithm_settings(algorithm: AlgorithmSummary) -> Mapping[str, Sequence[Rule]]:
    return {
        "observable_when": algorithm.conditions,
        "accept_when": algorithm.accepts,
        "timeout": _plain(f"{algorithm.timeout_s:g} s", algorithm.place),
        **{f"identifies {variable}": (rule,) for variable, rule in algorithm.identifies.items()},
        **{f"returns {name}": _plain(_type(kind), algorithm.place) for name, kind in algorithm.returns.items()},
    }


def _plain(text: str, place: Place | None) -> Sequence[Rule]:
    return (Rule(python=text, source_text=text, place=place),)


def _type(declared: ValueType) -> str:
    ends = "" if declared.range is None else f" from {declared.range[0]:g} to {declared.range[1]:g}"
    unit, members = f" {declared.unit}" if declared.unit else "", ", ".join(declared.members)
    return f"{'optional ' if declared.optional else ''}{declared.kind}{unit}{ends}{members and f' of {members}'}"


def _upstream(names: Iterable[str], *summaries: SpecSummary) -> Sequence[str]:
    """Return the variables, algorithms and observers that some names depend on, the nearest first."""
    visited = list(names)
    for name in visited:
        visited.extend(source for summary in summaries for source in _sources(name, summary) if source not in visited)
    return visited


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
