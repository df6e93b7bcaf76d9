"""Checks of poses in conditions (phase 5): a pose becomes stale when it is no longer reported."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.language.check.index.graph_schema import KnowledgeElement
from codra_dsl.language.check.index.mentions import user_of
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.check.knowledge.mentions import names_in_pattern, patterns
from codra_dsl.language.check.knowledge.owners import is_knowledge_checkable
from codra_dsl.language.diagnostics import Diagnostic, Place, Related
from codra_dsl.language.expression import names_in, reads_of


def unnoticed_poses(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """If conditions use the poses of an edge, and the edge has a writer, the edge states how long a pose is valid."""
    if not is_knowledge_checkable(spec_index, faults):
        return
    first_uses: dict[str, Related] = {}
    for user, name, place in _pose_uses(spec_index):
        _, first, second = reads_of(name)
        for edge_name in spec_index.declared_graph.pose_edges_between(first, second):
            first_uses.setdefault(edge_name, Related(f"{user} uses it", place))
    for name, related in first_uses.items():
        edge = spec_index.declared_graph.edges[name]
        has_validity = edge.motion is None or edge.motion.is_static or edge.motion.valid_for_s is not None
        if not has_validity and spec_index.declared_graph.writers(KnowledgeElement("edges", name)):
            yield finding(
                "unnoticed-pose",
                f"edge '{name}' keeps its last pose forever if no new pose is reported",
                edge.place,
                path=f"knowledge.edges.{name}",
                help="add 'valid_for', for example 'valid_for: forever', or 'static: true' if the pose never changes",
                related=(related,),
            )


def _pose_uses(spec_index: SpecIndex) -> Iterator[tuple[str, str, Place]]:
    """Yield the user, the name and the place of each name that reads poses in a condition."""
    for pose_condition in spec_index.spec.pose_conditions:
        section, element, _ = pose_condition.owner
        for name in names_in(pose_condition.tree):
            yield user_of(section, element), name.name, pose_condition.condition.place_of(name)
    for pattern in patterns(spec_index):
        for name in names_in_pattern(pattern):
            if reads_of(name.name)[0]:
                yield pattern.user, name.name, pattern.condition.place_of(name)


STALE_POSE_CHECKS = (unnoticed_poses,)
"""The checks of this module."""
