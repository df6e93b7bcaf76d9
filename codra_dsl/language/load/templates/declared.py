"""The part of a template that a spec keeps, for findings about unused elements, for `diff` and for editors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from codra_dsl.language.load.templates.templates import INSTANCE, Template
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, SequenceNode, YamlNode
from codra_dsl.language.load.yaml.reader import entries
from codra_dsl.language.model import DeclaredParameter, DeclaredTemplate


def declared_template(template: Template, *, is_used: bool) -> DeclaredTemplate:
    """Return the part of a template that a spec keeps: its declaration, and the outside names to which it refers."""
    mentions = template.mentions()
    return DeclaredTemplate(
        name=template.name,
        place=template.subject.origin.of(template.subject.key),
        is_used=is_used,
        parameters=tuple(
            DeclaredParameter(
                name=name,
                type=parameter.kind.value,
                default=None if parameter.default is None else parameter.default.text,
                place=parameter.place,
                mentions=tuple(mentions.get(name, ())),
            )
            for name, parameter in template.parameters.items()
            if name != INSTANCE
        ),
        resources=tuple(_names_under(template.sections.get("perception"), "uses")),
        sources=tuple(_writers(template.sections)),
    )


def _writers(sections: Mapping[str, MappingNode]) -> Iterator[str]:
    """Yield the names of the writers of a template's elements, and of the participants in its tasks."""
    for section in ("context", "types", "edges"):
        yield from _names_under(sections.get(section), "source")
    for section in ("types", "edges"):
        for _, element in entries(sections.get(section)):
            yield from _names_under(element.value("attributes") if isinstance(element, MappingNode) else None, "source")
    for key in ("by", "requesters"):
        yield from _names_under(sections.get("tasks"), key)


def _names_under(elements: YamlNode | None, key: str) -> Iterator[str]:
    """Yield the names under a key of a section's elements: one name, a list, or the keys of a mapping."""
    for _, element in entries(elements):
        value = element.value(key) if isinstance(element, MappingNode) else None
        if isinstance(value, ScalarNode):
            yield value.text
        elif isinstance(value, SequenceNode):
            yield from (item.text for item in value.items if isinstance(item, ScalarNode))
        elif isinstance(value, MappingNode):
            yield from value.entries
