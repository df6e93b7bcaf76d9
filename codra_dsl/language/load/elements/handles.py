"""Read how a site or a timeline makes the handles of resources."""

from __future__ import annotations

import keyword
from collections.abc import Iterable, Iterator, Mapping

from codra_dsl.language.diagnostics import Related
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.elements.values import read_literal
from codra_dsl.language.load.schema.document import section_of
from codra_dsl.language.load.schema.keys_and_values import explain
from codra_dsl.language.load.schema.schema import has_shape
from codra_dsl.language.load.site.site_file import SiteFile
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.language.load.yaml.nodes import MappingNode
from codra_dsl.language.load.yaml.origin import Subject
from codra_dsl.language.load.yaml.reader import Reader, entries
from codra_dsl.language.model import Handle, Resource

_KEYS = ("call", "with")


def take_handles(site_file: SiteFile, findings: Findings) -> Iterator[Handle]:
    """Remove `call` and `with` from the resources of a site, and yield the handles that they describe."""
    for key, node in entries(section_of(site_file.root, "resources")):
        subject = Subject("resources", key, site_file.origin)
        if not has_shape("site_resource", node.data):
            explain("site_resource", node, subject, findings)
        stated_keys = [name for name in _KEYS if isinstance(node, MappingNode) and name in node.entries]
        if not isinstance(node, MappingNode) or not stated_keys:
            continue
        maker = MappingNode(node.start, node.end, flow=node.flow)
        for name in stated_keys:
            name_node = node.entries[name][0]
            maker.put(name_node, node.take(name) or name_node)
        damaged: frozenset[str] = frozenset()
        if not has_shape("handle_maker", maker.data):
            damaged = explain("handle_maker", maker, subject, findings)
        handle = read_handle(Reader(subject, maker, findings, damaged), subject.name, "write package.module:name")
        if handle is not None:
            yield handle


def report_handles_of_slots(handles: Iterable[Handle], resources: Mapping[str, Resource], findings: Findings) -> None:
    """Report handles of resources that have slots instead."""
    for handle in handles:
        resource = resources.get(handle.resource)
        if resource is not None and resource.slots is not None:
            message = f"the resource {shown(handle.resource)} has slots, so it has no handle"
            related = [Related("declared here", resource.place)]
            path, help_text = f"resources.{handle.resource}.call", "remove 'call' and 'with'"
            findings.add("misplaced-key", message, handle.place, help=help_text, path=path, related=related)


def read_handle(reader: Reader, resource: str, call_help: str, *steps: str) -> Handle | None:
    """Return the handle of a resource that `call` and `with` describe; None if it cannot be read.

    Args:
        reader: the reader of the mapping.
        resource: the name of the resource.
        call_help: the help about a call that is not the name of a class or function.
        steps: the path from the reader's element to the mapping.
    """
    call = reader.scalar("call")
    arguments = tuple(
        (key.text, read_literal(reader, value, *steps, "with", key.text))
        for key, value in entries(reader.node.value("with"))
    )
    if call is None:
        return None
    module, _, function = call.text.partition(":")
    words = (*module.split("."), *function.split("."))
    if not all(word.isidentifier() and not keyword.iskeyword(word) for word in words):
        message = f"{shown(call.text)} is not the name of a class or function"
        reader.fail("call", message, call, call_help, *steps, "call")
    if reader.damaged:
        return None
    places = tuple(reader.origin.of(key) for key, _ in entries(reader.node.value("with")))
    return Handle(
        resource=resource, call=call.text, arguments=arguments, place=reader.origin.of(call), argument_places=places
    )
