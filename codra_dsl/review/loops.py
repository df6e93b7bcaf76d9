"""What became of loops: metrics and actions with their rules, adaptations and their filters, trees, and who does it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from codra_dsl.check.mape.checked import CheckedTree
from codra_dsl.diagnostics import Place, suggest
from codra_dsl.model import Adaptation, Course, Loop, Output, Parameter, Reference, Spec, TreeElement, Variable
from codra_dsl.review.changes import Category, Change
from codra_dsl.review.version import Pair, Side, seconds

_Element = Output | Adaptation | TreeElement | Loop
_NOUNS = {"metric": "metric", "action": "action", "adaptation": "adaptation", "tree": "tree", "loop": "loop"}
_Told = tuple[str, Category, str, object, object]
"""A key, what its change is and means, and what it is in A and in B; texts are shown."""


def loop_changes(pair: Pair) -> Iterator[Change]:
    """Yield what became of loops and their parts; nothing where neither version says anything of them."""
    old, new = pair.old.plan.checked.spec, pair.new.plan.checked.spec
    if not (old.adapts or new.adapts):
        return
    for kind in _NOUNS:
        before, after = _table(old, kind), _table(new, kind)
        yield from _came_and_went(pair, kind, before, after)
        for name, element in before.items():
            if name in after:
                yield from _Comparison(pair, kind, element, after[name]).changes()
    for name, variable in pair.old.variables.items():
        other = pair.new.variables.get(name)
        if other is not None and not other.is_derived:
            yield from _of_words(pair, variable, other)


def _table(spec: Spec, kind: str) -> Mapping[str, _Element]:
    several: Mapping[str, tuple[_Element, ...]] = {
        "metric": spec.metrics,
        "action": spec.actions,
        "adaptation": spec.adaptation,
        "tree": spec.trees,
        "loop": spec.loops,
    }
    return {each.name: each for each in several[kind]}


def _came_and_went(
    pair: Pair, kind: str, before: Mapping[str, _Element], after: Mapping[str, _Element]
) -> Iterator[Change]:
    for name, element in before.items():
        if name not in after:
            near = suggest(name, sorted(set(after) - set(before)))
            hint = "" if near is None else f"; '{near}' looks like its new name"
            yield Change(
                category=Category.REMOVED,
                element=pair.old.id(kind, name),
                message=f"the {_NOUNS[kind]} is gone{hint}",
                before=element.place,
            )
    for name, element in after.items():
        if name not in before:
            message = f"new {_NOUNS[kind]}"
            yield Change(category=Category.ADDED, element=pair.new.id(kind, name), message=message, after=element.place)


def _of_words(pair: Pair, old: Variable, new: Variable) -> Iterator[Change]:
    """Yield what became of the terms of a variable, and of how it follows from another."""
    terms, rates = (_terms(old), _terms(new)), (_rate(old), _rate(new))
    told: tuple[_Told, ...] = (
        ("terms", Category.REDEFINED, "its terms mean something else", terms[0], terms[1]),
        ("rate_of", Category.REDEFINED, "it is another rate", rates[0], rates[1]),
    )
    element = pair.new.id("context", new.name)
    yield from _changes(element, told, (old.place, old.places), (new.place, new.places))


def _rate(variable: Variable) -> str:
    rate = variable.rate
    if rate is None:
        return ""
    return f"{'-' if rate.is_falling else ''}{rate.of.name} over {seconds(rate.over_s)}"


@dataclass(frozen=True, slots=True)
class _Comparison:
    """The comparison of one element in A with the one of the same name in B."""

    pair: Pair
    kind: str
    old: _Element
    new: _Element

    def changes(self) -> Iterator[Change]:
        """Yield all that is another."""
        element = self.pair.new.id(self.kind, self.new.name)
        before, after = (self.old.place, self.old.places), (self.new.place, self.new.places)
        label: _Told = ("label", Category.WORDING, "has another label", repr(self.old.label), repr(self.new.label))
        told = (*self._told(), label)
        yield from _changes(element, told, before, after)

    def _told(self) -> tuple[_Told, ...]:
        match self.old, self.new:
            case Output() as old, Output() as new:
                return _of_output(old, new)
            case Adaptation() as old, Adaptation() as new:
                return _of_adaptation(old, new)
            case TreeElement() as old, TreeElement() as new:
                return (*_of_tree(old, new), *self._of_file(old.name))
            case Loop() as old, Loop() as new:
                return _of_loop(old, new)
        return ()

    def _of_file(self, name: str) -> tuple[_Told, ...]:
        forests = _forest(self.pair.old, name), _forest(self.pair.new, name)
        return (("file", Category.REDEFINED, "its file says something else", *forests),)


def _forest(side: Side, name: str) -> object:
    mape = side.plan.checked.mape
    trees: tuple[CheckedTree, ...] = mape.trees if mape is not None else ()
    return next((tuple(file.trees for file in tree.forest.forest.files) for tree in trees if tree.name == name), None)


def _of_output(old: Output, new: Output) -> tuple[_Told, ...]:
    rules = _differing(_rules(old), _rules(new))
    return (
        ("rules", Category.REDEFINED, "follows from other rules", *rules),
        ("terms", Category.REDEFINED, "its terms mean something else", _terms(old), _terms(new)),
        ("inference", Category.REDEFINED, "comes to its number otherwise", old.method, new.method),
        ("worse", Category.REDEFINED, "its other end is the bad one", old.worse.value, new.worse.value),
    )


def _rules(output: Output) -> list[str]:
    return [" ".join(rule.text.split()) for rule in output.rules]


def _terms(holder: Output | Variable) -> dict[str, str]:
    return {each.name: each.text for each in holder.terms}


def _differing(old: list[str], new: list[str]) -> tuple[str, str]:
    """Return the rules that stand in one version only."""
    lost, gained = ([each for each in one if each not in other] for one, other in ((old, new), (new, old)))
    return "; ".join(lost), "; ".join(gained)


def _of_adaptation(old: Adaptation, new: Adaptation) -> tuple[_Told, ...]:
    one, other = old.does, new.does
    dwell: _Told = ("dwell", Category.REDEFINED, "is kept for another time", seconds(old.dwell_s), seconds(new.dwell_s))
    if isinstance(one, Course) and isinstance(other, Course):
        return (*_of_course(one, other), dwell)
    if isinstance(one, Parameter) and isinstance(other, Parameter):
        return (
            ("set", Category.REDEFINED, "sets another variable", one.variable.name, other.variable.name),
            ("value", Category.REDEFINED, "sets it to something else", one.value.text, other.value.text),
            dwell,
        )
    return (("set", Category.REDEFINED, "adapts in another way", isinstance(one, Course), isinstance(other, Course)),)


def _of_course(old: Course, new: Course) -> tuple[_Told, ...]:
    times = (("smooth", "smooth_s"), ("hold", "hold_s"), ("cooldown", "cooldown_s"), ("abort", "abort_s"))
    return (
        ("choose", Category.REDEFINED, "chooses among others", _names(old.choose), _names(new.choose)),
        ("in", Category.REDEFINED, "is the course of another tree", old.within.name, new.within.name),
        ("otherwise", Category.REDEFINED, "falls back on another action", old.otherwise.name, new.otherwise.name),
        ("lead", Category.REDEFINED, "asks for another lead", f"{old.lead:g}", f"{new.lead:g}"),
        ("always", Category.REDEFINED, "has other hard rules", _hard_rules(old), _hard_rules(new)),
        *(
            (key, Category.REDEFINED, "is filtered otherwise", seconds(getattr(old, name)), seconds(getattr(new, name)))
            for key, name in times
        ),
    )


def _hard_rules(course: Course) -> str:
    return "; ".join(f"{rule.action.name} if {rule.condition.text}" for rule in course.always)


def _branches(tree: TreeElement) -> str:
    return ", ".join(f"{action.name}: {id_.name}" for action, id_ in tree.course)


def _leaves(tree: TreeElement) -> dict[str, str]:
    return {each.leaf.name: _names(each.tasks) for each in tree.leaves}


def _of_tree(old: TreeElement, new: TreeElement) -> tuple[_Told, ...]:
    branches = _branches(old), _branches(new)
    leaves = _leaves(old), _leaves(new)
    agents = "" if old.agent is None else old.agent.name, "" if new.agent is None else new.agent.name
    return (
        ("course", Category.REDEFINED, "actions are other branches", *branches),
        ("leaves", Category.REDEFINED, "its leaves hand over other tasks", *leaves),
        ("agent", Category.UNWRITABLE, "another agent executes it", *agents),
        ("period", Category.REDEFINED, "is ticked at another pace", seconds(old.period_s), seconds(new.period_s)),
        ("repeat", Category.REDEFINED, "goes on otherwise when it is done", old.repeat.value, new.repeat.value),
    )


def _of_loop(old: Loop, new: Loop) -> tuple[_Told, ...]:
    keys = ("monitor", "analyse", "adapt", "execute")
    slower = new.period_s > old.period_s
    return (
        *(
            (key, Category.REDEFINED, "does something else", _names(getattr(old, key)), _names(getattr(new, key)))
            for key in keys
        ),
        (
            "period",
            Category.SLOWER if slower else Category.FASTER,
            f"analyses {'less' if slower else 'more'} often",
            seconds(old.period_s),
            seconds(new.period_s),
        ),
    )


def _names(references: tuple[Reference, ...]) -> str:
    return ", ".join(each.name for each in references)


_Placed = tuple[Place, Mapping[str, Place]]


def _changes(element: str, told: tuple[_Told, ...], before: _Placed, after: _Placed) -> Iterator[Change]:
    for key, category, message, old, new in told:
        if old == new:
            continue
        texts = [value if isinstance(value, str) and value else None for value in (old, new)]
        yield Change(
            category=category,
            element=element,
            key=key,
            message=message,
            was=texts[0],
            now=texts[1],
            before=before[1].get(key, before[0]),
            after=after[1].get(key, after[0]),
        )
