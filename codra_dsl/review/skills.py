"""What became of skills: what they declare, what they expect, what they invalidate."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from codra_dsl.diagnostics import Place, suggest
from codra_dsl.model import Expectation, Expected, Reference, Skill
from codra_dsl.review.changes import Category, Change
from codra_dsl.review.guards import Relation, either, relation
from codra_dsl.review.version import Pair, seconds


def skill_changes(pair: Pair) -> Iterator[Change]:
    """Yield what became of each skill."""
    old, new = pair.old.skills, pair.new.skills
    for name, skill in old.items():
        if name not in new:
            near = suggest(name, sorted(set(new) - set(old)))
            hint = "" if near is None else f"; '{near}' looks like its new name"
            element = pair.old.id("skill", name)
            yield Change(
                category=Category.REMOVED, element=element, message=f"the skill is gone{hint}", before=skill.place
            )
        else:
            yield from _Comparison(pair, skill, new[name]).changes()
    for name in sorted(set(new) - set(old)):
        element = pair.new.id("skill", name)
        yield Change(category=Category.ADDED, element=element, message="new skill", after=new[name].place)


class _Comparison:
    """The comparison of a skill in A with the one in B."""

    def __init__(self, pair: Pair, old: Skill, new: Skill) -> None:
        self._pair = pair
        self._old, self._new = old, new

    def changes(self) -> Iterator[Change]:
        """Yield all that is another."""
        monitored = (
            tuple(each.variable for each in self._old.monitor),
            tuple(each.variable for each in self._new.monitor),
        )
        yield from self._declared("preview", self._old.preview, self._new.preview)
        yield from self._declared("monitor", *monitored)
        yield from self._invalidated()
        yield from self._expected()

    def _change(
        self,
        category: Category,
        key: str,
        message: str,
        *told: str | None,
        places: tuple[Place | None, Place | None] = (None, None),
    ) -> Change:
        was, now = told or (None, None)
        before, after = places
        return Change(
            category=category,
            element=self._pair.new.id("skill", self._new.name),
            key=key,
            message=message,
            was=was,
            now=now,
            before=before or self._old.places.get(key, self._old.place),
            after=after or self._new.places.get(key, self._new.place),
        )

    def _declared(self, key: str, old: tuple[Reference, ...], new: tuple[Reference, ...]) -> Iterator[Change]:
        lost, gained = self._lost(old, new), self._lost(new, old)
        verb = {"preview": "previews", "monitor": "monitors"}[key]
        if lost:
            yield self._change(Category.UNDECLARED, key, f"no longer {verb} {_quoted(lost)}")
        if gained:
            yield self._change(Category.ADDED, key, f"{verb} {_quoted(gained)} as well")

    def _lost(self, old: Iterable[Reference], new: Iterable[Reference]) -> list[str]:
        """Return the variables that are in both versions and that only one list names."""
        kept = {reference.name for reference in new} | self._pair.one_sided
        return sorted({reference.name for reference in old} - kept)

    def _invalidated(self) -> Iterator[Change]:
        lost, gained = (
            self._lost(self._old.changes, self._new.changes),
            self._lost(self._new.changes, self._old.changes),
        )
        if lost:
            message = f"acting no longer makes {_quoted(lost)} unknown"
            yield self._change(Category.WEAKER, "changes", message)
        if gained:
            message = f"acting makes {_quoted(gained)} unknown"
            yield self._change(Category.STRONGER, "changes", message)

    def _expected(self) -> Iterator[Change]:
        """Yield what became of expectations; those of one variable and one sort are paired in their order."""
        old, new = _by_subject(self._old.monitor), _by_subject(self._new.monitor)
        for subject in dict.fromkeys((*old, *new)):
            if subject[0] in self._pair.one_sided:
                continue
            before, after = list(old.get(subject, ())), list(new.get(subject, ()))
            for one, other in zip(before, after, strict=False):
                yield from self._compared(one, other)
            for one in before[len(after) :]:
                message = f"'{_said(one)}' is no longer expected"
                yield self._change(Category.WEAKER, "monitor", message, places=(one.place, None))
            for other in after[len(before) :]:
                message = f"'{_said(other)}' is expected now"
                yield self._change(Category.STRONGER, "monitor", message, places=(None, other.place))

    def _compared(self, old: Expectation, new: Expectation) -> Iterator[Change]:
        decided = self._relation(old, new)
        was, now = f"'{_said(old)}'", f"'{_said(new)}'"
        found = {
            Relation.WEAKER: (Category.WEAKER, "an expectation is met more often"),
            Relation.STRONGER: (Category.STRONGER, "an expectation is met less often"),
            Relation.OTHER: (Category.GUARD_CHANGED, "another thing is expected"),
        }.get(decided)
        if found is not None:
            yield self._change(found[0], "monitor", found[1], was, now, places=(old.place, new.place))

    def _relation(self, old: Expectation, new: Expectation) -> Relation:
        by_time = _compared_times(old.within_s, new.within_s)
        by_condition = self._relation_of_conditions(old, new)
        if by_time is by_condition or by_time is Relation.SAME:
            return by_condition
        return by_time if by_condition is Relation.SAME else Relation.OTHER

    def _relation_of_conditions(self, old: Expectation, new: Expectation) -> Relation:
        name = new.variable.name
        before, after = ({name: side.variables[name].type} for side in (self._pair.old, self._pair.new))
        if old.condition is None or new.condition is None or not (old.condition.tree and new.condition.tree):
            return Relation.SAME
        return relation([old.condition.tree], [new.condition.tree], either(before, after))


def _by_subject(monitor: Iterable[Expectation]) -> dict[tuple[str, Expected], list[Expectation]]:
    found: dict[tuple[str, Expected], list[Expectation]] = {}
    for each in monitor:
        if each.expected is not Expected.WATCHED:
            found.setdefault((each.variable.name, each.expected), []).append(each)
    return found


def _compared_times(old_s: float | None, new_s: float | None) -> Relation:
    if old_s == new_s:
        return Relation.SAME
    return Relation.WEAKER if (new_s or float("inf")) > (old_s or float("inf")) else Relation.STRONGER


def _said(each: Expectation) -> str:
    within = "" if each.within_s is None else f" within {seconds(each.within_s)}"
    condition = "" if each.condition is None else f": {each.condition.text}"
    return f"{each.variable.name} {each.expected}{within}{condition}"


def _quoted(names: Iterable[str]) -> str:
    return ", ".join(f"'{name}'" for name in names)
