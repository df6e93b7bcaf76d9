"""Convert elements of BehaviorTree.CPP version 3 to version 4, as the library's guide to migration describes it.

`BlackboardCheckInt` and its siblings are not converted: they check again while their child runs, and no node of
version 4 does the same.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from codra_dsl.language.behavior_trees.catalogue import AUTOREMAP, BUILT_IN
from codra_dsl.language.behavior_trees.elements import Element
from codra_dsl.language.behavior_trees.ports import is_key
from codra_dsl.language.behavior_trees.values import Attribute

_NODES = {
    "SequenceStar": "SequenceWithMemory",
    "RetryUntilSuccesful": "RetryUntilSuccessful",
    "SubTreePlus": "SubTree",
}
ONLY_IN_VERSION_3 = frozenset(f"BlackboardCheck{type_}" for type_ in ("Int", "Double", "String", "Bool"))
"""The nodes that are not converted."""

_PARALLEL_PORTS = {
    "threshold": "success_count",
    "success_threshold": "success_count",
    "failure_threshold": "failure_count",
}
_EXPLICIT_TAGS = ("Control", "Decorator")
_SHARES_ENTRIES = "__shared_blackboard"
_OLD_AUTOREMAP = "__autoremap"


def is_of_version_3(root: Element) -> bool:
    """Return whether a file without version has a node or an attribute that only version 3 has."""
    tree_ids = _tree_ids(root)
    return any(
        _node_id(element) in _NODES
        or element.tag in tree_ids
        or any(
            attribute.name in (_SHARES_ENTRIES, _OLD_AUTOREMAP)
            or (_node_id(element) == "Parallel" and attribute.name in _PARALLEL_PORTS)
            for attribute in element.attributes
        )
        for element in _elements(root)
    )


def convert_from_version_3(root: Element) -> None:
    """Convert all elements of a file to version 4."""
    tree_ids = _tree_ids(root)
    for element in _elements(root):
        element.attributes = tuple(map(_without_dollar, element.attributes))
        if element.tag in tree_ids:
            id_attribute = Attribute(name="ID", value=element.tag, place=element.place, value_place=element.place)
            element.tag, element.attributes = "SubTree", (id_attribute, *element.attributes)
        if element.tag == "SubTree":
            element.attributes = tuple(map(_outer_entry, element.attributes))
        elif _node_id(element) == "Parallel":
            element.attributes = tuple(_renamed(attribute, _PARALLEL_PORTS) for attribute in element.attributes)
        element.attributes = tuple(
            replace(attribute, value=_NODES.get(attribute.value, attribute.value))
            if attribute.name == "ID" and element.tag in _EXPLICIT_TAGS
            else _renamed(attribute, {_SHARES_ENTRIES: AUTOREMAP, _OLD_AUTOREMAP: AUTOREMAP})
            for attribute in element.attributes
        )
        element.tag = _NODES.get(element.tag, element.tag)


def _elements(root: Element) -> Iterator[Element]:
    """Yield all elements of the trees, but not of the models."""
    pending = [child for child in root.children if child.tag == "BehaviorTree"]
    while pending:
        element = pending.pop()
        yield element
        pending += element.children


def _tree_ids(root: Element) -> frozenset[str]:
    """Return the IDs of the trees of a file; in version 3, such an ID can be the tag of a subtree."""
    ids = (child.get("ID") for child in root.children if child.tag == "BehaviorTree")
    return frozenset(id_attribute.value for id_attribute in ids if id_attribute is not None) - BUILT_IN.keys()


def _node_id(element: Element) -> str:
    id_attribute = element.get("ID") if element.tag in _EXPLICIT_TAGS else None
    return element.tag if id_attribute is None else id_attribute.value


def _outer_entry(attribute: Attribute) -> Attribute:
    """Return a port of `SubTree`, whose value is the name of an entry without braces in version 3."""
    is_port = attribute.name not in ("ID", "name") and not attribute.name.startswith("_")
    return replace(attribute, value=f"{{{attribute.value}}}") if is_port and is_key(attribute.value) else attribute


def _without_dollar(attribute: Attribute) -> Attribute:
    """Return an attribute with `{entry}` in place of `${entry}`, which version 3 reads alike."""
    value = attribute.value
    is_entry = value.startswith("${") and value.endswith("}") and is_key(value[2:-1])
    return replace(attribute, value=value[1:]) if is_entry else attribute


def _renamed(attribute: Attribute, names: dict[str, str]) -> Attribute:
    return replace(attribute, name=names.get(attribute.name, attribute.name))
