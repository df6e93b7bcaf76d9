"""Checks of knowledge (phase 5): types that no node can have."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.language.check.index.graph_schema import KnowledgeElement
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import Silenced, SpecIndex
from codra_dsl.language.check.knowledge.owners import is_knowledge_complete
from codra_dsl.language.diagnostics import Diagnostic


def unused_types(scope: SpecIndex, faults: Silenced) -> Iterator[Diagnostic]:
    """Every type has an initial node, or an agent may insert one. Types of parts may be for other specs."""
    if not is_knowledge_complete(scope, faults):
        return
    used_types = {node.type.name for node in scope.spec.nodes}
    for kind in scope.spec.types:
        is_own = kind.place.span.file == scope.spec.file
        if is_own and kind.name not in used_types and not scope.world.writers(KnowledgeElement("types", kind.name)):
            message = f"no node has type '{kind.name}', and no agent may insert one"
            help = "use it as the type of a node, name an agent that inserts such nodes under 'source', or remove it"
            path = f"knowledge.types.{kind.name}"
            yield finding("unused-type", message, kind.place, path=path, help=help)


UNUSED_KNOWLEDGE = (unused_types,)
"""The checks of this module."""
