"""Phase 5 for knowledge: types that nothing can be of."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.check.knowledge.owners import is_whole
from codra_dsl.check.knowledge.world import Thing
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import Faults, Scope
from codra_dsl.diagnostics import Diagnostic


def unused_types(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """Of every type there is a node from the start, or somebody may insert some; those of parts may be for others."""
    if not is_whole(scope, faults):
        return
    taken = {node.type.name for node in scope.spec.nodes}
    for kind in scope.spec.types:
        own = kind.place.span.file == scope.spec.file
        if own and kind.name not in taken and not scope.world.writers(Thing("types", kind.name)):
            message = f"there is no node of type '{kind.name}', and nobody may insert one"
            way_out = "name it as type of a node, say with 'source' who inserts such nodes, or remove it"
            path = f"knowledge.types.{kind.name}"
            yield finding("unused-type", message, kind.place, path=path, way_out=way_out)


KNOWLEDGE_LEFTOVERS = (unused_types,)
"""The rules of this subject."""
