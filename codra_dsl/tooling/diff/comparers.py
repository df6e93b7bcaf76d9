"""Comparers that are used for several fields: for sizes, names, types, writers and guards."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any

from codra_dsl.language.check import Types
from codra_dsl.language.check.index.graph_schema import KnowledgeElement
from codra_dsl.language.check.solver.intervals import in_base
from codra_dsl.language.expression import Node
from codra_dsl.language.model import Condition, Kind, NodeType, Rate, Reference, StartingPose, ValueType, Writer
from codra_dsl.language.units import ONE, Unit, parse_unit
from codra_dsl.tooling.diff.changes import Category, Change
from codra_dsl.tooling.diff.guards import Relation, find_relation, is_equal
from codra_dsl.tooling.diff.version import duration_text
from codra_dsl.tooling.diff.walk import (
    Comparer,
    Scope,
    Wording,
    compare_by_default,
    equality_comparer,
    is_nested,
    plain_value,
    text_of,
)

GUARD_WORDINGS: Mapping[Relation, Wording] = {
    Relation.WEAKER: (Category.WEAKER, "holds more often"),
    Relation.STRONGER: (Category.STRONGER, "holds less often"),
    Relation.OTHER: (Category.GUARD_CHANGED, "holds in other situations"),
}


def compare_nothing(*_: Any) -> Iterator[Change]:
    """Yield no change: the field makes no difference by itself, or another comparer takes it into account."""
    yield from ()


def compare_inline(scope: Scope, _: str, old: Any, new: Any) -> Iterator[Change]:
    """Yield the changes of a nested value without a key of its own. Specs write its keys among the keys of the element.

    If the values have different classes, yield nothing.
    """
    if is_nested(old, new):
        yield from scope.inner_scope("", old, new).changes()


def compare_rate(scope: Scope, _: str, old: Rate | None, new: Rate | None) -> Iterator[Change]:
    """Yield the change of a rate, a share or a held bool, under the key with which the spec declares it."""
    if old != new:
        declared = new or old
        assert declared is not None
        yield from equality_comparer(show=_rate_text)(scope, declared.kind.value, old, new)


def _rate_text(rate: Rate | None) -> str:
    if rate is None:
        return ""
    direction_text = ", counts falling" if rate.is_falling else ""
    return f"{rate.of.name} {rate.duration_key} {duration_text(rate.over_s)}{direction_text}"


def show_nothing(_: object) -> str:
    """Return an empty text, for values that are too long to be shown."""
    return ""


def show_pose(pose: StartingPose | None) -> str:
    """Return a pose as specs write it, without coordinates that are 0; empty for None."""
    if pose is None:
        return ""
    values = (*pose.translation_m, *pose.rotation_rad)
    entries = zip(("x", "y", "z", "roll", "pitch", "yaw"), values, ("m",) * 3 + ("rad",) * 3, strict=True)
    return f"{{{', '.join(f'{key}: {value:.10g} {unit}' for key, value, unit in entries if value)}}}"


def order_comparer(
    increase_wording: Wording,
    decrease_wording: Wording,
    show: Callable[[Any], str] = text_of,
    rank_of: Callable[[Any], Any] = lambda value: value,
) -> Comparer:
    """Return the comparer of values with an order.

    A larger value is reported with `increase_wording`, a smaller one with `decrease_wording`.
    """

    def compare(scope: Scope, key: str, old: Any, new: Any) -> Iterator[Change]:
        if rank_of(old) != rank_of(new):
            category, message = increase_wording if rank_of(new) > rank_of(old) else decrease_wording
            yield scope.make_change(category, key, message, show(old), show(new))

    return compare


def growth_comparer(increase_category: Category, decrease_category: Category) -> Comparer:
    """Return the comparer of durations and numbers. If a value is None, both values are only compared for equality."""

    def compare(scope: Scope, key: str, old: Any, new: Any) -> Iterator[Change]:
        if old is None or new is None:
            yield from compare_by_default(scope, key, old, new)
            return
        is_duration = isinstance(new, float)
        increase_word, decrease_word = ("longer", "shorter") if is_duration else ("larger", "smaller")
        wordings = (
            (increase_category, f"'{key}' is {increase_word}"),
            (decrease_category, f"'{key}' is {decrease_word}"),
        )
        yield from order_comparer(*wordings, duration_text if is_duration else str)(scope, key, old, new)

    return compare


def name_comparer(loss_wording: Wording, gain_wording: Wording) -> Comparer:
    """Return the comparer of unordered lists of names or of conditions. The entries are compared one by one.

    If the messages contain `{}`, the entries are variables, and `{}` is replaced by the lost or gained variables.
    Variables that only one version of the spec has are left out, because they are reported as added or removed.
    """

    def compare(scope: Scope, key: str, old: Any, new: Any) -> Iterator[Change]:
        before, after = ({plain_value(entry): text_of(entry) for entry in entries} for entries in (old, new))
        for (category, message), texts, other_texts in ((loss_wording, before, after), (gain_wording, after, before)):
            changed_texts = {text for entry, text in texts.items() if entry not in other_texts}
            if "{}" not in message and changed_texts:
                yield scope.make_change(category, key, message, text_of(old), text_of(new))
            elif changed_texts - scope.pair.one_sided_variable_names:
                yield scope.make_change(
                    category, key, message.format(quote_names(changed_texts - scope.pair.one_sided_variable_names))
                )

    return compare


def quote_names(names: Iterable[str]) -> str:
    """Return names as messages list them."""
    return ", ".join(f"'{name}'" for name in sorted(names))


# Types


def type_comparer(
    retyped_category: Category = Category.RETYPED,
    narrowed_category: Category = Category.NARROWED,
    widened_category: Category = Category.WIDENED,
) -> Comparer:
    """Return the comparer of types, whose units and ranges are compared by meaning."""

    def compare(scope: Scope, key: str, old: ValueType, new: ValueType) -> Iterator[Change]:
        units = _unit_of(old), _unit_of(new)
        values_key, value_noun = ("values", "members") if old.kind is Kind.ENUM else ("range", "values")
        has_lost_values, has_gained_values = _value_loss_and_gain(old, new)
        is_comparable = old.kind is new.kind and units[0].dimension == units[1].dimension
        for category, changed_key, message, has_changed in (
            (retyped_category, "type", "has another type", old.kind is not new.kind),
            (retyped_category, "unit", "has another unit", old.kind is new.kind and units[0] != units[1]),
            (narrowed_category, values_key, f"has lost {value_noun}", is_comparable and has_lost_values),
            (widened_category, values_key, f"has new {value_noun}", is_comparable and has_gained_values),
        ):
            if has_changed:  # a changed type of an entry, such as an attribute, is reported under the key of the entry
                yield scope.make_change(
                    category, "" if scope.path else changed_key, message, text_of(old), text_of(new)
                )
        yield from scope.inner_scope(key, old, new).changes()

    return compare


def _unit_of(value_type: ValueType) -> Unit:
    return (None if value_type.unit is None else parse_unit(value_type.unit)) or ONE


def _value_loss_and_gain(old: ValueType, new: ValueType) -> tuple[bool, bool]:
    """Return whether a type has lost values, and whether it has gained values. Ranges are compared in one unit."""
    if old.kind is Kind.ENUM:
        return not {*old.values} <= {*new.values}, not {*new.values} <= {*old.values}
    (low, high), (new_low, new_high) = _range_of(old), _range_of(new)
    return new_low > low or new_high < high, new_low < low or new_high > high


def _range_of(value_type: ValueType) -> tuple[Fraction | float, Fraction | float]:
    if value_type.range is None:
        return float("-inf"), float("inf")
    low, high = (in_base(end, _unit_of(value_type)) for end in value_type.range)
    return low, high


# Writers


def compare_writers(scope: Scope, key: str, old: Sequence[Writer], new: Sequence[Writer]) -> Iterator[Change]:
    """Yield the changes of the writers of a type, an edge or an attribute.

    The writers are named under `source` of the element, or are agents that list the element under `owns`.
    """
    element, value = scope.elements[1], scope.values[1]
    if old or new or not scope.path:  # an attribute without sources has the writers of its type or edge
        section = "types" if isinstance(element, NodeType) else "edges"
        knowledge_element = KnowledgeElement(section, element.name, value.name if scope.path else "")
        yield from _compare_writer_lists(
            scope, key, *(side.declared_graph.writers(knowledge_element) for side in scope.pair.sides)
        )


def compare_variable_writers(
    scope: Scope, key: str, old: Sequence[Reference], new: Sequence[Reference]
) -> Iterator[Change]:
    """Yield the changes of the writers of a variable.

    The writers are named under `source` of the variable, or are agents that list the variable under `owns`.
    """
    sources = ([source for source in references if source.name != "observer"] for references in (old, new))
    yield from _compare_writer_lists(scope, key, *map(_make_writers, sources), no_writer_text="observers only")
    name = scope.values[1].name
    if all(name in side.declared_graph.variables for side in scope.pair.sides):
        owner_lists = (
            [
                writer
                for writer in side.declared_graph.writers(KnowledgeElement("context", name))
                if writer.name not in map(text_of, references)
            ]
            for side, references in zip(scope.pair.sides, (old, new), strict=True)
        )
        yield from _compare_writer_lists(scope, "owns", *owner_lists)


def compare_requesters(scope: Scope, key: str, old: Sequence[Reference], new: Sequence[Reference]) -> Iterator[Change]:
    """Yield the changes of the agents that may request a task."""
    yield from _compare_writer_lists(scope, key, _make_writers(old), _make_writers(new))


def _make_writers(references: Iterable[Reference]) -> list[Writer]:
    return [Writer(name=reference.name, place=reference.place) for reference in references]


def _compare_writer_lists(
    scope: Scope, key: str, old: Sequence[Writer], new: Sequence[Writer], *, no_writer_text: str = "nobody"
) -> Iterator[Change]:
    before, after = ([writer.name for writer in writers] for writers in (old, new))
    lost_writers, added_writers = sorted({*before} - {*after}), sorted({*after} - {*before})
    common_writers = {*before} & {*after}
    for category, message, has_changed in (
        (Category.UNWRITABLE, f"{', '.join(lost_writers)} may not write it any more", lost_writers),
        (Category.WIDENED, f"{', '.join(added_writers)} may write it as well", added_writers),
        (
            Category.REDEFINED,
            "its writers have another order",
            _priority_groups(old, common_writers) != _priority_groups(new, common_writers),
        ),
    ):
        if has_changed:
            yield scope.make_change(
                category, key, message, *(", ".join(names) or no_writer_text for names in (before, after))
            )


def _priority_groups(writers: Sequence[Writer], common_names: set[str]) -> list[list[str]]:
    """Return the common writers in groups of equal priority. The group with the highest priority is first."""
    priorities = {writer.name: writer.priority or 0 for writer in writers if writer.name in common_names}
    return [
        sorted(name for name, own_priority in priorities.items() if own_priority == priority)
        for priority in sorted({*priorities.values()}, reverse=True)
    ]


# Guards


def guard_comparer(find_types: Callable[[Scope, Sequence[Condition]], Types]) -> Comparer:
    """Return the comparer of conditions that must all be true; `find_types` returns the types of the names in them."""

    def compare(scope: Scope, key: str, old: Sequence[Condition], new: Sequence[Condition]) -> Iterator[Change]:
        types = find_types(scope, (*old, *new))
        before, after = ([condition.tree for condition in conditions if condition.tree] for conditions in (old, new))
        guard_relation = find_relation(before, after, types)
        if guard_relation is not Relation.SAME:
            category, message = GUARD_WORDINGS[guard_relation]
            lost_conditions, gained_conditions = (
                _conditions_not_in(after, old, types),
                _conditions_not_in(before, new, types),
            )
            condition_texts = (
                " and ".join(f"'{condition.text}'" for condition in conditions) or "no such condition"
                for conditions in (lost_conditions, gained_conditions)
            )
            first_conditions = next(iter(lost_conditions), None), next(iter(gained_conditions), None)
            yield scope.make_change(
                category, key, f"'{key}' {message}", *condition_texts, changed_parts=first_conditions
            )

    return compare


def _conditions_not_in(trees: Sequence[Node], conditions: Sequence[Condition], types: Types) -> list[Condition]:
    """Return the conditions that differ from all of the given trees."""
    return [
        condition
        for condition in conditions
        if condition.tree and not any(is_equal(condition.tree, tree, types) for tree in trees)
    ]
