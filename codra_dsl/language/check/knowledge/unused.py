"""Checks of knowledge (phase 5): types that no node can have."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.language.check.index.graph_schema import KnowledgeElement
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.check.knowledge.owners import is_knowledge_checkable
from codra_dsl.language.diagnostics import Diagnostic


def unused_types(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Every type has an initial node, or an agent may insert such a node. Types of parts may be for other specs."""
    if not is_knowledge_checkable(spec_index, faults):
        return
    used_type_names = {node.type.name for node in spec_index.spec.nodes}
    for node_type in spec_index.spec.types:
        is_in_own_file = node_type.place.span.file == spec_index.spec.file
        if (
            is_in_own_file
            and node_type.name not in used_type_names
            and not spec_index.declared_graph.writers(KnowledgeElement("types", node_type.name))
        ):
            message = f"no node has type '{node_type.name}', and no agent may insert such a node"
            help = "use it as the type of a node, name an agent that inserts such nodes under 'source', or remove it"
            path = f"knowledge.types.{node_type.name}"
            yield finding("unused-type", message, node_type.place, path=path, help=help)


UNUSED_TYPE_CHECKS = (unused_types,)
"""The checks of this module."""
