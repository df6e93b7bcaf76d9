"""Rules of phase 2: every context-variable has a source, and each tree consists of algorithms that fit together."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import NEED_KEYS, OBSERVER, FaultyElements, Group, SpecIndex
from codra_dsl.language.diagnostics import Diagnostic, Related
from codra_dsl.language.model import ADAPTER, Algorithm, ObserverSetting, Parameter, Reference


def unidentified_variables(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Every variable is identified by an algorithm or names another writer under `source`."""
    if spec_index.has_damage("perception", "identifies"):
        return
    unidentified_names = {
        name
        for name, variable in spec_index.variables.items()
        if name not in spec_index.producers and not variable.sources
    }
    undeclared_names = [name for name in spec_index.producers if not spec_index.declares("context", name)]
    set_names = {
        adaptation.does.variable.name: adaptation.name
        for adaptation in spec_index.spec.adaptation
        if isinstance(adaptation.does, Parameter)
    }
    for variable in spec_index.variables.values():
        name = variable.name
        # an undeclared name that an algorithm identifies may be a misspelling of this variable
        if name in unidentified_names and len(unidentified_names) <= len(undeclared_names):
            continue
        observer_sources = [source for source in variable.sources if source.name == OBSERVER]
        other_source_count = len(variable.sources) - len(observer_sources)
        if (
            name in spec_index.producers
            or name in faults.suggested_variables
            or not (faults.is_sound("context", name) and spec_index.is_readable("context", name, "source"))
            or (other_source_count and not observer_sources)
        ):
            continue
        if other_source_count:
            message = f"context-variable '{name}' has the source 'observer', but no algorithm identifies it"
            place, help = observer_sources[0].place, "remove 'observer', or add an algorithm that identifies it"
        else:
            message = f"nothing identifies context-variable '{name}'"
            place, help = (
                variable.place,
                "add an algorithm that identifies it, or name another writer of it under 'source'",
            )
            if name in set_names:
                help = f"write 'source: {ADAPTER}', since adaptation '{set_names[name]}' sets it"
        yield finding("unidentified-variable", message, place, path=f"context.{name}", help=help)


def variables_without_observer_source(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """A variable that an algorithm identifies has `observer` among its sources."""
    for name, producers in spec_index.producers.items():
        variable = spec_index.variables.get(name)
        if variable is None or not variable.sources or not faults.is_sound("context", name):
            continue
        if variable.derived is not None or not spec_index.is_readable("context", name, "source"):
            continue
        if OBSERVER not in (source.name for source in variable.sources):
            algorithm = spec_index.algorithms[producers[0]]
            sources = " and ".join(f"'{source.name}'" for source in variable.sources)
            message = (
                f"context-variable '{name}' comes only from {sources}, but algorithm '{algorithm.name}' identifies it"
            )
            yield finding(
                "observer-is-no-source",
                message,
                variable.places.get("source", variable.place),
                path=f"context.{name}.source",
                help="add 'observer' to 'source'",
                related=(Related("identified here", _identifying_reference(algorithm, name).place),),
            )


def same_ranks(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """Alternatives have different ranks, which define the order in which they are tried."""
    for group in spec_index.groups:
        if len(group.algorithms) == 1:  # the most frequent case
            continue
        for rank in sorted({algorithm.rank for algorithm in group.algorithms}):
            tied_algorithms = sorted(
                (algorithm for algorithm in group.algorithms if algorithm.rank == rank),
                key=lambda algorithm: algorithm.place.span,
            )
            if (
                len(tied_algorithms) > 1
                and _are_all_declared(spec_index, group)
                and _are_readable(spec_index, tied_algorithms, "rank")
            ):
                yield _same_rank_finding(group, tied_algorithms, rank)


def incomplete_first_alternatives(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """The first of several alternatives identifies every variable of their tree."""
    for group in spec_index.groups:
        is_sound = _are_all_declared(spec_index, group) and _are_readable(
            spec_index, group.algorithms, "rank", "identifies"
        )
        if group.variables_beyond_first and group.has_distinct_ranks and is_sound:
            first, missing_name = group.algorithms[0], group.variables_beyond_first[0]
            other = next(algorithm for algorithm in group.algorithms if _identifies(algorithm, missing_name))
            yield finding(
                "incomplete-first-alternative",
                f"algorithm '{first.name}' is the first of its alternatives, but does not identify '{missing_name}'",
                first.places.get("identifies", first.place),
                path=f"perception.{first.name}.identifies",
                help=f"identify '{missing_name}' here as well, "
                "or in an algorithm that shares no variable with this algorithm",
                related=(
                    Related(
                        f"algorithm '{other.name}' identifies it", _identifying_reference(other, missing_name).place
                    ),
                ),
            )


def observers_without_algorithm(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """The entries under `observers` contain only variables that an algorithm identifies."""
    if spec_index.has_damage("perception", "identifies"):
        return
    for setting in spec_index.spec.observers:
        for reference in setting.identifies:
            variable = spec_index.variables.get(reference.name)
            if (
                variable is None
                or reference.name in spec_index.producers
                or reference.name in faults.suggested_variables
            ):
                continue
            if any(source.name != OBSERVER for source in variable.sources):
                message = f"'{reference.name}' in observer '{setting.name}' has no algorithm that identifies it"
                path, help = _identifies_path(setting), "remove it: observers use only algorithms"
                yield finding("observer-without-algorithm", message, reference.place, path=path, help=help)


def variables_in_two_observers(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """Each variable is in at most one observer, since a tree has one name, period and priority."""
    for setting in spec_index.spec.observers:
        reported_owners: set[str] = set()
        for reference in setting.identifies:
            owner, first = spec_index.claims[reference.name]
            if owner.name != setting.name and owner.name not in reported_owners:
                reported_owners.add(owner.name)
                message = f"'{reference.name}' in observer '{setting.name}' is also in observer '{owner.name}'"
                help = f"keep '{reference.name}' in only one of the two observers"
                related = (Related(f"in observer '{owner.name}'", first.place),)
                yield finding(
                    "variable-in-two-observers",
                    message,
                    reference.place,
                    path=_identifies_path(setting),
                    help=help,
                    related=related,
                )


def observers_mixing_trees(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """An observer joins trees of different algorithms only if the algorithms have the same set of preconditions."""
    for setting in spec_index.spec.observers:
        groups = _groups_of_observer(spec_index, setting)
        incompatible_groups = (group for group in groups[1:] if not _can_join(groups[0], group))
        incompatible_group = next(incompatible_groups, None)
        if incompatible_group is not None and _is_sound_observer(spec_index, faults, setting, groups):
            yield _mixed_trees_finding(setting, groups[0], incompatible_group)


def observers_splitting_trees(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """The entry of an observer contains all variables of the observer's tree."""
    for setting in spec_index.spec.observers:
        groups = _groups_of_observer(spec_index, setting)
        if not _is_sound_observer(spec_index, faults, setting, groups) or any(
            not _can_join(groups[0], group) for group in groups[1:]
        ):
            continue
        observer_variable_names = {reference.name for reference in setting.identifies}
        for group in groups:
            missing_names = [
                name for name in group.variables if name not in observer_variable_names and name in spec_index.variables
            ]
            claiming_settings = [spec_index.claims[name][0] for name in missing_names if name in spec_index.claims]
            is_claimed_later = any(other.place.span > setting.place.span for other in claiming_settings)
            if missing_names and not is_claimed_later:
                yield _split_tree_finding(spec_index, setting, group, missing_names[0])


def observer_names_taken(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """No observer has the name that another tree gets from its first algorithm."""
    if spec_index.has_damage("observers", "identifies"):
        return
    first_algorithms_of_unnamed_trees = {
        group.algorithms[0].name.casefold(): group.algorithms[0]
        for group in spec_index.groups
        if not any(name in spec_index.claims for name in group.variables)
    }
    for setting in spec_index.spec.observers:
        other = first_algorithms_of_unnamed_trees.get(setting.name.casefold())
        if other is not None:
            message = f"observer '{setting.name}' has the name of the tree of algorithm '{other.name}'"
            yield finding(
                "observer-name-taken",
                message,
                setting.place,
                path=f"observers.{setting.name}",
                help="choose another name, or give that tree a name under 'observers' as well",
                related=(Related("the algorithm", other.place),),
            )


SOURCE_CHECKS = (
    unidentified_variables,
    variables_without_observer_source,
    same_ranks,
    incomplete_first_alternatives,
    observers_without_algorithm,
    variables_in_two_observers,
    observers_mixing_trees,
    observers_splitting_trees,
    observer_names_taken,
)
"""The rules of this phase."""


def _same_rank_finding(group: Group, tied_algorithms: list[Algorithm], rank: int) -> Diagnostic:
    first, second, *rest = tied_algorithms
    names_text = " and ".join(f"'{algorithm.name}'" for algorithm in tied_algorithms)
    shared_name = max(
        group.variables, key=lambda name: sum(_identifies(algorithm, name) for algorithm in tied_algorithms)
    )
    return finding(
        "same-rank",
        f"algorithms {names_text} are alternatives for '{shared_name}' and share rank {rank}",
        second.places.get("rank", second.place),
        path=f"perception.{second.name}.rank",
        help="give each of them a different 'rank': the algorithm with the smallest rank is tried first",
        related=tuple(
            Related(f"algorithm '{algorithm.name}'", algorithm.places.get("rank", algorithm.place))
            for algorithm in (first, *rest)
        ),
    )


def _mixed_trees_finding(setting: ObserverSetting, first: Group, other: Group) -> Diagnostic:
    one, two = first.algorithms[0], other.algorithms[0]
    algorithm_with_alternative = next(
        (group.algorithms[0] for group in (first, other) if len(group.algorithms) > 1), None
    )
    reason = (
        "whose conditions differ"
        if algorithm_with_alternative is None
        else f"and '{algorithm_with_alternative.name}' has an alternative"
    )
    return finding(
        "observer-mixes-trees",
        f"observer '{setting.name}' joins algorithms '{one.name}' and '{two.name}', {reason}",
        setting.places.get("identifies", setting.place),
        path=_identifies_path(setting),
        help="declare a separate observer for each, or give both the same 'observable_when' and 'given'",
        related=tuple(Related(f"algorithm '{algorithm.name}'", algorithm.place) for algorithm in (one, two)),
    )


def _split_tree_finding(spec_index: SpecIndex, setting: ObserverSetting, group: Group, missing_name: str) -> Diagnostic:
    algorithm = next(candidate for candidate in group.algorithms if _identifies(candidate, missing_name))
    owner = spec_index.claims[missing_name][0].name if missing_name in spec_index.claims else None
    where_text = "" if owner is None else f"; it is in observer '{owner}'"
    message = (
        f"observer '{setting.name}' leaves out '{missing_name}', which algorithm '{algorithm.name}' identifies as well"
    )
    return finding(
        "observer-splits-tree",
        message + where_text,
        setting.places.get("identifies", setting.place),
        path=_identifies_path(setting),
        help=f"add '{missing_name}': an observer contains all variables of its tree",
        related=(Related("identified here", _identifying_reference(algorithm, missing_name).place),),
    )


def _identifies_path(setting: ObserverSetting) -> str:
    return f"observers.{setting.name}.identifies"


def _identifies(algorithm: Algorithm, name: str) -> bool:
    return any(entry.variable.name == name for entry in algorithm.identifies)


def _identifying_reference(algorithm: Algorithm, name: str) -> Reference:
    return next(entry.variable for entry in algorithm.identifies if entry.variable.name == name)


def _groups_of_observer(spec_index: SpecIndex, setting: ObserverSetting) -> tuple[Group, ...]:
    """Return the groups that identify the variables of an observer, in the order of these variables."""
    groups = (spec_index.group_of.get(reference.name) for reference in setting.identifies)
    return tuple(dict.fromkeys(group for group in groups if group is not None))


def _are_all_declared(spec_index: SpecIndex, group: Group) -> bool:
    """Return whether all variables of a group are declared. Otherwise another group may be intended."""
    return all(spec_index.declares("context", name) for name in group.variables)


def _is_sound_observer(
    spec_index: SpecIndex, faults: FaultyElements, setting: ObserverSetting, groups: Iterable[Group]
) -> bool:
    """Return whether an observer and the algorithms of its trees have no finding."""
    is_shared = any(spec_index.claims[reference.name][0].name != setting.name for reference in setting.identifies)
    is_readable = spec_index.is_readable("observers", setting.name, "identifies")
    if is_shared or not is_readable or not faults.is_sound("observers", setting.name):
        return False
    return all(
        _are_all_declared(spec_index, group)
        and _are_readable(spec_index, group.algorithms, *NEED_KEYS, "identifies", "rank")
        and group.has_distinct_ranks
        and not group.variables_beyond_first
        and all(faults.is_sound("perception", algorithm.name) for algorithm in group.algorithms)
        for group in groups
    )


def _are_readable(spec_index: SpecIndex, algorithms: Iterable[Algorithm], *keys: str) -> bool:
    return all(spec_index.is_readable("perception", algorithm.name, *keys) for algorithm in algorithms)


def _can_join(one: Group, other: Group) -> bool:
    if len(one.algorithms) > 1 or len(other.algorithms) > 1:
        return False
    return _preconditions(one.algorithms[0]) == _preconditions(other.algorithms[0])


def _preconditions(algorithm: Algorithm) -> frozenset[object]:
    """Return the preconditions of an algorithm as a set; conditions with equal syntax trees are equal."""
    conditions = {condition.tree for condition in algorithm.observable_when}
    return frozenset(conditions) | {reference.name for reference in algorithm.given}
