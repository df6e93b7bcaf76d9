"""What became of knowledge and agents: what there can be, who may write it, what tasks end with, what agents do."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

from codra_dsl.check import Types
from codra_dsl.check.knowledge.world import Thing, World
from codra_dsl.diagnostics import Place, suggest
from codra_dsl.expression import Name, Path, to_text, walk
from codra_dsl.model import (
    Agent,
    Attribute,
    Condition,
    EdgeType,
    Motion,
    NodeElement,
    NodeType,
    Reference,
    Task,
    Writer,
)
from codra_dsl.review.changes import Category, Change
from codra_dsl.review.guards import Relation, relation
from codra_dsl.review.variables import described, lost_and_gained, same_measure
from codra_dsl.review.version import Pair, seconds

_Element = NodeType | NodeElement | EdgeType | Task | Agent
_NOUNS = {"type": "type of nodes", "node": "node", "edge": "type of edges", "task": "task", "agent": "agent"}


def knowledge_changes(pair: Pair) -> Iterator[Change]:
    """Yield what became of knowledge and of agents; nothing where neither version says anything of knowledge."""
    old, new = (World(side.plan.checked.spec) for side in (pair.old, pair.new))
    if not (old.spec.knows or new.spec.knows):
        return
    tables: tuple[tuple[str, Mapping[str, _Element], Mapping[str, _Element]], ...] = (
        ("type", old.types, new.types),
        ("node", old.nodes, new.nodes),
        ("edge", old.edges, new.edges),
        ("task", old.tasks, new.tasks),
        ("agent", old.agents, new.agents),
    )
    for kind, before, after in tables:
        yield from _came_and_went(pair, kind, before, after)
        for name in before:
            if name in after:
                yield from _Comparison(pair, (old, new), kind, before[name], after[name]).changes()
    yield from _claims(pair, old, new)


def _came_and_went(
    pair: Pair, kind: str, before: Mapping[str, _Element], after: Mapping[str, _Element]
) -> Iterator[Change]:
    for name, element in before.items():
        if name not in after:
            near = suggest(name, sorted(set(after) - set(before)))
            hint = "" if near is None else f"; '{near}' looks like its new name"
            message = f"the {_NOUNS[kind]} is gone{hint}"
            yield Change(
                category=Category.REMOVED, element=pair.old.id(kind, name), message=message, before=element.place
            )
    for name, element in after.items():
        if name not in before:
            message = f"new {_NOUNS[kind]}"
            yield Change(category=Category.ADDED, element=pair.new.id(kind, name), message=message, after=element.place)


def _claims(pair: Pair, old: World, new: World) -> Iterator[Change]:
    """Yield who owns a context-variable, by saying so of itself, in one version only."""
    for name in old.variables:
        if name not in new.variables:
            continue
        thing = Thing("context", name)
        places = (old.variables[name].place, new.variables[name].place)
        claims = tuple(
            tuple(writer for writer in world.writers(thing) if writer.name not in _sources(world, name))
            for world in (old, new)
        )
        yield from _of_writers(pair.new.id("context", name), "owns", claims[0], claims[1], places)


def _sources(world: World, variable: str) -> frozenset[str]:
    return frozenset(each.name for each in world.variables[variable].sources)


def _of_writers(
    element: str, key: str, before: tuple[Writer, ...], after: tuple[Writer, ...], places: tuple[Place, Place]
) -> Iterator[Change]:
    """Yield who may write something no more, or too, or goes before others now."""
    names = [[writer.name for writer in each] for each in (before, after)]
    was, now = (", ".join(each) or "nobody" for each in names)
    lost, gained = sorted(set(names[0]) - set(names[1])), sorted(set(names[1]) - set(names[0]))
    common = [each for each in names[0] if each in names[1]]
    ranks = [_ranks(each, common) for each in (before, after)]
    told: list[tuple[Category, str]] = []
    if lost:
        told.append((Category.UNWRITABLE, f"{', '.join(lost)} may not write it any more"))
    if gained:
        told.append((Category.WIDENED, f"{', '.join(gained)} may write it as well"))
    if ranks[0] != ranks[1]:
        told.append((Category.REDEFINED, "another of its writers goes first"))
    for category, message in told:
        yield Change(
            category=category,
            element=element,
            key=key,
            message=message,
            was=was,
            now=now,
            before=places[0],
            after=places[1],
        )


def _ranks(writers: tuple[Writer, ...], common: list[str]) -> list[list[str]]:
    """Return some writers, those first that go before others; equal ones together."""
    priorities = {writer.name: writer.priority or 0 for writer in writers if writer.name in common}
    return [
        sorted(name for name, each in priorities.items() if each == priority)
        for priority in sorted(set(priorities.values()), reverse=True)
    ]


@dataclass(frozen=True, slots=True)
class _Comparison:
    """The comparison of one element in A with the one of the same name in B."""

    pair: Pair
    worlds: tuple[World, World]
    kind: str
    old: _Element
    new: _Element

    def changes(self) -> Iterator[Change]:
        """Yield all that is another."""
        match self.old, self.new:
            case NodeType() as old, NodeType() as new:
                yield from self._written("types")
                yield from self._attributes("types", old.attributes, new.attributes)
                yield from self._told(
                    "view", Category.REDEFINED, "it sees another part of the world", old.view, new.view
                )
            case NodeElement() as old, NodeElement() as new:
                types = (old.type.name, new.type.name)
                yield from self._told("type", Category.RETYPED, "has another type", *types, *types)
                before, after = ({each.name: (each.value, each.unit) for each in side.values} for side in (old, new))
                yield from self._told("with", Category.REDEFINED, "something else is known at first", before, after)
            case EdgeType() as old, EdgeType() as new:
                yield from self._edge(old, new)
            case Task() as old, Task() as new:
                yield from self._task(old, new)
            case Agent() as old, Agent() as new:
                yield from self._agent(old, new)
        yield from self._labelled()

    def _edge(self, old: EdgeType, new: EdgeType) -> Iterator[Change]:
        category = Category.RETYPED if (old.motion is None) is not (new.motion is None) else Category.API
        yield from self._told("label", category, "carries another label", *2 * (old.label, new.label))
        yield from self._ends("from", old.origins, new.origins)
        yield from self._ends("to", old.targets, new.targets)
        yield from self._written("edges")
        yield from self._attributes("edges", old.attributes, new.attributes)
        if old.motion is not None and new.motion is not None:
            yield from self._motion(old.motion, new.motion)
            yield from self._told("pose", Category.REDEFINED, "it stands elsewhere from the start", old.pose, new.pose)

    def _motion(self, old: Motion, new: Motion) -> Iterator[Change]:
        """Compare how poses are kept, and how long they count: conditions that ask for them are known as long."""
        yield from self._lasting("valid_for", "its last pose counts", old.valid_s, new.valid_s)
        rest = replace(old, valid_for_s=new.valid_for_s)
        yield from self._told("motion", Category.REDEFINED, "its poses are kept or continued otherwise", rest, new)

    def _lasting(self, key: str, what: str, old_s: float, new_s: float) -> Iterator[Change]:
        if old_s != new_s:
            longer = new_s > old_s
            category = Category.WEAKER if longer else Category.STRONGER
            message = f"{what} {'longer' if longer else 'for less time'}"
            yield self._change(category, key, message, seconds(old_s), seconds(new_s))

    def _ends(self, key: str, old: Iterable[Reference], new: Iterable[Reference]) -> Iterator[Change]:
        before, after = [each.name for each in old], [each.name for each in new]
        was, now = ", ".join(before), ", ".join(after)
        if not set(before) <= set(after):
            yield self._change(Category.NARROWED, key, f"leads {key} fewer", was, now)
        if not set(after) <= set(before):
            yield self._change(Category.WIDENED, key, f"leads {key} more", was, now)

    def _task(self, old: Task, new: Task) -> Iterator[Change]:
        message = "another node does it"
        yield from self._told("from", Category.RETYPED, message, *2 * (old.origin.name, new.origin.name))
        yield from self._told("by", Category.UNWRITABLE, "another agent executes it", *2 * (old.by.name, new.by.name))
        asked = [tuple(Writer(name=each.name, place=each.place) for each in side.requesters) for side in (old, new)]
        yield from _of_writers(self._element, "requesters", asked[0], asked[1], self._places("requesters"))
        results = [[each.name for each in side.results] for side in (old, new)]
        was, now = (", ".join(each) for each in results)
        if not set(results[0]) <= set(results[1]):
            yield self._change(Category.NARROWED, "results", "has lost results", was, now)
        if not set(results[1]) <= set(results[0]):
            yield self._change(Category.WIDENED, "results", "has new results", was, now)
        for key in ("acknowledge", "finish"):
            before_s, after_s = getattr(old, f"{key}_s"), getattr(new, f"{key}_s")
            if before_s != after_s:
                longer = after_s > before_s
                category = Category.SLOWER if longer else Category.STRONGER
                message = f"is aborted {'later' if longer else 'earlier'}"
                yield self._change(category, key, message, seconds(before_s), seconds(after_s))

    def _agent(self, old: Agent, new: Agent) -> Iterator[Change]:
        phases = [each.conduct.phase and each.conduct.phase.value for each in (old, new)]
        yield from self._told("phase", Category.REDEFINED, "is another part of its loop", *phases, *phases)
        wakes = old.conduct.wakes, new.conduct.wakes
        if bool(wakes[0]) is not bool(wakes[1]):
            message = "has to be woken" if wakes[1] else "is always active"
            yield self._change(Category.GUARD_CHANGED if wakes[1] else Category.WIDENED, "wakes", message)
        else:
            before, after = map(_texts, wakes)
            if set(before) - set(after):
                yield self._change(Category.GUARD_CHANGED, "wakes", "is not woken any more", *_differing(before, after))
            elif set(after) - set(before):
                yield self._change(Category.WIDENED, "wakes", "is woken by more", *_differing(before, after))
        yield from self._rules(old, new)

    def _rules(self, old: Agent, new: Agent) -> Iterator[Change]:
        before, after = ({rule.name: rule for rule in each.conduct.rules} for each in (old, new))
        for name in before:
            if name not in after:
                yield self._change(Category.REMOVED, f"rules.{name}", f"rule '{name}' is gone")
                continue
            for moment in ("before", "during", "after"):
                patterns = getattr(before[name], moment), getattr(after[name], moment)
                yield from self._guard(f"rules.{name}.{moment}", *patterns)
        for name in after:
            if name not in before:
                yield self._change(Category.ADDED, f"rules.{name}", f"new rule '{name}'")

    def _guard(self, key: str, old: tuple[Condition, ...], new: tuple[Condition, ...]) -> Iterator[Change]:
        before, after = _texts(old), _texts(new)
        lost = [before[text] for text in before if text not in after]
        gained = [after[text] for text in after if text not in before]
        found = {
            Relation.WEAKER: (Category.WEAKER, "holds more often"),
            Relation.STRONGER: (Category.STRONGER, "holds less often"),
            Relation.OTHER: (Category.GUARD_CHANGED, "asks for something else"),
        }.get(self._relation(lost, gained))
        if found is not None:
            yield self._change(found[0], key, found[1], *_differing(before, after))

    def _relation(self, lost: list[Condition], gained: list[Condition]) -> Relation:
        """Return what became of a list of patterns, given those that are in one version only."""
        if not lost or not gained:
            return Relation.WEAKER if lost else Relation.STRONGER if gained else Relation.SAME
        trees = [[each.tree for each in side if each.tree is not None] for side in (lost, gained)]
        if any(isinstance(tree, Path) for side in trees for tree in side):
            return Relation.OTHER
        return relation(trees[0], trees[1], self._types(lost + gained))

    def _types(self, conditions: list[Condition]) -> Types:
        """Return the types of what conditions read; None where it is another in B."""
        trees = (each.tree for each in conditions if each.tree is not None)
        names = dict.fromkeys(part.name for tree in trees for part in walk(tree) if isinstance(part, Name))
        old, new = self.worlds
        return {name: found if (found := old.read_type(name)) == new.read_type(name) else None for name in names}

    def _written(self, section: str) -> Iterator[Change]:
        yield from self._writers_of(Thing(section, self.old.name), "source")

    def _writers_of(self, thing: Thing, key: str) -> Iterator[Change]:
        before, after = (world.writers(thing) for world in self.worlds)
        yield from _of_writers(self._element, key, before, after, self._places(key))

    def _attributes(self, section: str, old: Iterable[Attribute], new: Iterable[Attribute]) -> Iterator[Change]:
        before, after = ({each.name: each for each in attributes} for attributes in (old, new))
        for name in before:
            key = f"attributes.{name}"
            if name not in after:
                yield self._change(Category.REMOVED, key, f"attribute '{name}' is gone")
                continue
            yield from self._of_type(key, before[name], after[name])
            if before[name].sources or after[name].sources:  # else it has those of its holder, which are told there
                yield from self._writers_of(Thing(section, self.old.name, name), f"{key}.source")
        for name in after:
            if name not in before:
                yield self._change(Category.ADDED, f"attributes.{name}", f"new attribute '{name}'")

    def _of_type(self, key: str, old: Attribute, new: Attribute) -> Iterator[Change]:
        was, now = described(old.type), described(new.type)
        if old.type.kind is not new.type.kind or not same_measure(old.type, new.type):
            yield self._change(Category.RETYPED, key, "has another type", was, now)
            return
        lost, gained = lost_and_gained(old.type, new.type)
        if lost:
            yield self._change(Category.NARROWED, key, "has lost values", was, now)
        if gained:
            yield self._change(Category.WIDENED, key, "has new values", was, now)
        yield from self._lasting(f"{key}.valid_for", "evidence stands", old.valid_for_s, new.valid_for_s)
        if old.history != new.history:
            fewer = new.history < old.history
            message = f"{'fewer' if fewer else 'more'} readings are kept"
            category = Category.STRONGER if fewer else Category.EASED
            yield self._change(category, f"{key}.history", message, str(old.history), str(new.history))

    def _labelled(self) -> Iterator[Change]:
        if isinstance(self.old, EdgeType):
            return
        labels = [each.conduct.label if isinstance(each, Agent) else each.label for each in (self.old, self.new)]
        yield from self._told("label", Category.WORDING, "has another label", *labels, *map(repr, labels))

    def _told(
        self, key: str, category: Category, message: str, old: object, new: object, *told: str | None
    ) -> Iterator[Change]:
        if old != new:
            yield self._change(category, key, message, *told)

    @property
    def _element(self) -> str:
        return self.pair.new.id(self.kind, self.new.name)

    def _places(self, key: str) -> tuple[Place, Place]:
        return _at(self.old, key), _at(self.new, key)

    def _change(self, category: Category, key: str, message: str, *told: str | None) -> Change:
        was, now = told or (None, None)
        before, after = self._places(key)
        return Change(
            category=category,
            element=self._element,
            key=key,
            message=message,
            was=was,
            now=now,
            before=before,
            after=after,
        )


def _at(element: _Element, key: str) -> Place:
    places = element.conduct.places if isinstance(element, Agent) else element.places
    return places.get(key.partition(".")[0], element.place)


def _texts(patterns: Iterable[Condition]) -> dict[str, Condition]:
    """Return patterns by a text that does not depend on blanks."""
    return {_text(each): each for each in patterns}


def _text(pattern: Condition) -> str:
    if pattern.tree is None:
        return pattern.text
    write: Callable[..., str] = str if isinstance(pattern.tree, Path) else to_text
    return write(pattern.tree)


def _differing(before: Iterable[str], after: Iterable[str]) -> tuple[str | None, str | None]:
    """Return what stands in one version only, quoted."""
    old, new = list(before), list(after)
    lost, gained = [each for each in old if each not in new], [each for each in new if each not in old]
    was, now = (", ".join(f"'{each}'" for each in several) or None for several in (lost, gained))
    return was, now
