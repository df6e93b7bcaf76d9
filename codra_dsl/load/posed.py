"""The context-variables that comparisons with poses bring along: one for each that a condition over context makes.

So whatever reads context reads them: trees, the journal, `why`. Nobody can name one, so nobody else writes it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from codra_dsl.expression import names_in
from codra_dsl.model import POSES, Condition, Course, Kind, Posed, Reference, Spec, ValueType, Variable

_TRUTH = ValueType(kind=Kind.BOOL)


def with_posed(spec: Spec) -> Spec:
    """Return a spec with the context-variables that its comparisons with poses bring along."""
    derived: dict[str, Variable] = {}
    origins = dict(spec.origins)
    for owner, condition in _over_context(spec):
        for name in () if condition.tree is None else names_in(condition.tree):
            if name.asks is not None and name.name not in derived:
                derived[name.name] = _variable(name.name, Posed(tree=name.asks, said=condition, owner=owner))
                origins["context", name.name] = spec.origins[owner[0], owner[1]]
    return replace(spec, context=(*spec.context, *derived.values()), origins=origins) if derived else spec


def _over_context(spec: Spec) -> Iterator[tuple[tuple[str, str, str], Condition]]:
    """Yield each condition in which poses may be asked, with the section, the name and the key of what says it."""
    for algorithm in spec.perception:
        owner = ("perception", algorithm.name, "observable_when")
        yield from ((owner, condition) for condition in algorithm.observable_when)
    for adaptation in spec.adaptation:
        does, name = adaptation.does, adaptation.name
        if isinstance(does, Course):
            yield from ((("adaptation", name, "always"), rule.condition) for rule in does.always)
        else:
            yield ("adaptation", name, "value"), does.value


def _variable(name: str, posed: Posed) -> Variable:
    place = posed.said.place_of(posed.tree)
    sources = (Reference(name=POSES, place=place),)
    return Variable(name=name, type=_TRUTH, place=place, label=name, sources=sources, is_derived=True, posed=posed)
