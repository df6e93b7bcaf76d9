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
        return f"{self.owner}, {self.what}: {_rule_text(self.now)}; the run had {_rule_text(self.before)}"


def _rule_text(rule: Rule | None) -> str:
    if rule is None:
        return "none"
    return rule.text if rule.place is None else f"{rule.text} [{rule.place}]"


def changes_by_distance(names: Iterable[str], before: SpecSummary, now: SpecSummary) -> tuple[Change, ...]:
    """Return the differences between two versions, ordered by their distance from some variables or algorithms.

    `names` can also contain observers. The differences in the elements of `names` come first, then the differences in
    the algorithms that identify a variable, then in the variables that these algorithms need, and so on up the
    dependency graph.
    """
    positions = {owner: position for position, owner in enumerate(_upstream_names(names, before, now))}
    return tuple(sorted(find_changes(before, now), key=lambda change: positions.get(change.owner, len(positions))))


def find_changes(before: SpecSummary, now: SpecSummary) -> Iterator[Change]:
    """Yield the differences between two versions.

    For an element that only one version has, only the first of its settings is a difference.
    """
    old_settings, new_settings = _settings(before), _settings(now)
    common_owners = {owner for owner, _ in old_settings} & {owner for owner, _ in new_settings}
    reported_owners: set[str] = set()
    for key in dict.fromkeys((*new_settings, *old_settings)):
        owner = key[0]
        if owner not in reported_owners:
            for change in _setting_changes(*key, old_settings.get(key, ()), new_settings.get(key, ())):
                yield change
                reported_owners |= {owner} - common_owners


def _setting_changes(
    owner: str, setting_name: str, old_rules: Sequence[Rule], new_rules: Sequence[Rule]
) -> Iterator[Change]:
    old_texts, new_texts = {rule.python_text for rule in old_rules}, {rule.python_text for rule in new_rules}
    removed_rules = [rule for rule in old_rules if rule.python_text not in new_texts]
    added_rules = [rule for rule in new_rules if rule.python_text not in old_texts]
    for old_rule, new_rule in zip_longest(removed_rules, added_rules):
        yield Change(owner=owner, what=setting_name, before=old_rule, now=new_rule)


def _settings(summary: SpecSummary) -> Mapping[tuple[str, str], Sequence[Rule]]:
    """Return all settings that decide what happens in a run. The key is the owner and the name of the setting."""
    settings: dict[tuple[str, str], Sequence[Rule]] = {}
    for algorithm in summary.algorithms.values():
        settings |= {
            (algorithm.name, setting_name): rules for setting_name, rules in _algorithm_settings(algorithm).items()
        }
    for variable in summary.variables.values():
        place = summary.places.get(f"context/{variable.name}")
        settings[variable.name, "type"] = _rules_of_text(_type_text(variable.type), place)
        derivation = summary.find_derivation(variable.name)
        if derivation is not None:
            settings[variable.name, "derived"] = (derivation,)
        settings[variable.name, "source"] = _rules_of_text(" or ".join(variable.sources), place)
        settings[variable.name, "valid_for"] = _rules_of_text(f"{variable.valid_for_s:g} s", place)
        settings[variable.name, "when_unobservable"] = _rules_of_text(str(variable.when_unobservable), place)
    for observer in summary.observers.values():
        settings[observer.name, "algorithms"] = _rules_of_text(", ".join(observer.algorithms), observer.place)
        settings[observer.name, "period"] = _rules_of_text(f"{observer.period_s:g} s", observer.place)
    for skill in summary.skills.values():
        place = summary.places.get(f"skill/{skill.name}")
        settings[skill.name, "preview"] = (
            *_rules_of_text(", ".join(map(str, skill.preview)), place),
            *summary.previews.get(skill.name, ()),
        )
        settings[skill.name, "monitor"] = _rules_of_text(", ".join(map(str, skill.monitor)), place)
        settings[skill.name, "changes"] = _rules_of_text(", ".join(map(str, skill.changes)), place)
    return settings


def _algorithm_settings(algorithm: AlgorithmSummary) -> Mapping[str, Sequence[Rule]]:
    return {
        "observable_when": algorithm.preconditions,
        "accept_when": algorithm.acceptance_conditions,
        "timeout": _rules_of_text(f"{algorithm.timeout_s:g} s", algorithm.place),
        **{f"identifies {variable}": (rule,) for variable, rule in algorithm.identifies.items()},
        **{
            f"returns {name}": _rules_of_text(_type_text(value_type), algorithm.place)
            for name, value_type in algorithm.returns.items()
        },
    }


def _rules_of_text(text: str, place: Place | None) -> Sequence[Rule]:
    return (Rule(python_text=text, source_text=text, place=place),)


def _type_text(value_type: ValueType) -> str:
    range_text = "" if value_type.range is None else f" from {value_type.range[0]:g} to {value_type.range[1]:g}"
    unit_text, members_text = f" {value_type.unit}" if value_type.unit else "", ", ".join(value_type.members)
    optional_text = "optional " if value_type.optional else ""
    return f"{optional_text}{value_type.kind}{unit_text}{range_text}{members_text and f' of {members_text}'}"


def _upstream_names(names: Iterable[str], *summaries: SpecSummary) -> Sequence[str]:
    """Return some names, and the variables, algorithms and observers on which they depend, the nearest first."""
    visited_names = list(names)
    for name in visited_names:
        visited_names.extend(
            source for summary in summaries for source in _source_names(name, summary) if source not in visited_names
        )
    return visited_names


def _source_names(name: str, summary: SpecSummary) -> Iterator[str]:
    if name in summary.algorithms:
        rules = summary.algorithms[name].preconditions
        yield from sorted({variable for rule in rules for variable in rule.term.variables()})
    if name in summary.observers:
        yield from summary.observers[name].algorithms
    derivation = summary.find_derivation(name) if name in summary.variables else None
    if derivation is not None:
        yield from sorted(derivation.term.variables())
    observer = summary.find_observer(name)
    if observer is not None:
        yield from (algorithm.name for algorithm in summary.find_algorithms(name))
        yield observer.name
