"""The context-variables that the knowledge graph determines: one for each comparison with poses, distance and count.

Trees, the journal and `why` can read them like any other context-variable. A spec cannot name them, so no other source
can write them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from codra_dsl.language.expression import Count, Name, Node, is_distance, names_in, reads_of
from codra_dsl.language.model import POSES, Condition, Course, Kind, PoseCondition, Reference, Spec, ValueType, Variable

_TRUTH = ValueType(kind=Kind.BOOL)
_DISTANCE = ValueType(kind=Kind.FLOAT, unit="m")
_COUNT = ValueType(kind=Kind.INT)


def with_pose_conditions(spec: Spec) -> Spec:
    """Return a spec with the context-variables that its comparisons with poses imply."""
    variables: dict[str, Variable] = {}
    origins = dict(spec.origins)
    resolutions_m = {variable.name: variable.resolution_m for variable in spec.context}
    for owner, condition in _conditions_over_context(spec):
        for name in () if condition.tree is None else names_in(condition.tree):
            if name.pose_comparison is not None and name.name not in variables:
                resolution_m = resolutions_m.get(owner[1]) if is_distance(name) else None
                pose_condition = PoseCondition(
                    tree=name.pose_comparison, condition=condition, owner=owner, resolution_m=resolution_m
                )
                variables[name.name] = _variable(name.name, pose_condition)
                origins["context", name.name] = spec.origins[owner[0], owner[1]]
    return replace(spec, context=(*spec.context, *variables.values()), origins=origins) if variables else spec


def _conditions_over_context(spec: Spec) -> Iterator[tuple[tuple[str, str, str], Condition]]:
    """Yield each condition that may contain poses, with the section, name and key of its element."""
    for variable in spec.context:
        if variable.derived is not None:
            yield ("context", variable.name, "derived"), variable.derived
    for algorithm in spec.perception:
        owner = ("perception", algorithm.name, "observable_when")
        yield from ((owner, condition) for condition in algorithm.observable_when)
    for skill in spec.skills:
        yield from ((("skills", skill.name, "preview"), condition) for condition in skill.preview_conditions)
    for adaptation in spec.adaptation:
        does, name = adaptation.does, adaptation.name
        if isinstance(does, Course):
            yield from ((("adaptation", name, "always"), rule.condition) for rule in does.always)
        else:
            yield ("adaptation", name, "value"), does.value


def _variable(name: str, pose_condition: PoseCondition) -> Variable:
    place = pose_condition.condition.place_of(pose_condition.tree)
    sources = (Reference(name=POSES, place=place),)
    return Variable(
        name=name,
        type=_type_of(pose_condition.tree),
        place=place,
        label=name,
        sources=sources,
        is_derived=True,
        pose_condition=pose_condition,
    )


def _type_of(tree: Node) -> ValueType:
    if isinstance(tree, Count):
        return _COUNT if tree.function == "count" else _TRUTH
    is_number = isinstance(tree, Name) and reads_of(tree.name)[0] == "distance"
    return _DISTANCE if is_number else _TRUTH
