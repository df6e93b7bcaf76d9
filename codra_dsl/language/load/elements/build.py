"""Build elements: nodes -> values of the model. Keys that cannot be read get their default; the reader lists them."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterable
from enum import StrEnum
from typing import Any

from codra_dsl.language.expression import parse_over_context
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.elements.conditions import read_condition, read_conditions, untorn_items
from codra_dsl.language.load.elements.derivations import read_derivation
from codra_dsl.language.load.elements.loops import read_rate, read_terms
from codra_dsl.language.load.elements.monitor import read_expectation
from codra_dsl.language.load.elements.preview import read_preview
from codra_dsl.language.load.elements.topics import read_topic
from codra_dsl.language.load.elements.values import read_literal, read_type
from codra_dsl.language.load.yaml.names import check_name
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, YamlNode
from codra_dsl.language.load.yaml.reader import Reader, entries
from codra_dsl.language.model import (
    ALGORITHM_SETTINGS,
    DERIVED,
    FOREVER_S,
    Access,
    Algorithm,
    Condition,
    Expectation,
    Hysteresis,
    Identification,
    Kind,
    Literal,
    Members,
    ObserverSetting,
    Reference,
    Refresh,
    Resource,
    Returned,
    Setting,
    Skill,
    Usage,
    ValueType,
    Variable,
    WhenUnobservable,
)

MAX_CONFIRMED = 100
"""The maximum number of results in `confirm`."""

_ACCESSES = {access.value: access for access in Access}
_CALL = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*:[A-Za-z_]\w*", re.ASCII)
_CONFIRM = re.compile(r"([0-9]{1,9})\s+of\s+([0-9]{1,9})")


def build_variable(reader: Reader) -> Variable:
    """Return a context-variable."""
    derived, resolution_m = read_derivation(reader)
    value_type, sources = read_type(reader, reader.node), reader.references("source")
    return Variable(
        name=reader.subject.name,
        type=value_type,
        place=reader.place,
        label=reader.text("label", reader.subject.name),
        description=reader.text("description", ""),
        sources=sources if derived is None else (Reference(name=DERIVED, place=derived.place),),
        valid_for_s=reader.duration_s("valid_for", FOREVER_S, most="forever"),
        states_validity="valid_for" in reader.node.entries,
        when_unobservable=reader.choice("when_unobservable", WhenUnobservable.KEEP),
        refresh=reader.choice("refresh", Refresh.PERIODIC),
        history=reader.number("history", 100),
        node=reader.text("of", "context"),
        terms=read_terms(reader) if "terms" in reader.node.entries else (),
        rate=read_rate(reader),
        derived=derived,
        resolution_m=resolution_m,
        ros=read_topic(reader, value_type, sources),
        places=reader.places(),
    )


def build_algorithm(reader: Reader) -> Algorithm:
    """Return a perception algorithm."""
    return Algorithm(
        name=reader.subject.name,
        place=reader.place,
        call=_read_call(reader),
        parameters=tuple(_read_parameters(reader)),
        uses=tuple(_read_uses(reader)),
        given=reader.references("given"),
        returns=tuple(_read_returns(reader)),
        observable_when=read_conditions(reader, "observable_when", grammar=parse_over_context),
        accept_when=read_conditions(reader, "accept_when"),
        identifies=tuple(_read_identifies(reader)),
        rank=reader.number("rank", 1),
        places=reader.places(
            (f"with.{key.text}", (key.start, key.end)) for key, _ in entries(reader.node.value("with"))
        ),
        **{setting.field_name: _read_setting(reader, setting) for setting in ALGORITHM_SETTINGS},
    )


def _read_setting(reader: Reader, setting: Setting) -> Any:
    """Return the value of a setting; it has the same type as the setting's default."""
    if setting.key not in reader.node.entries:
        return setting.default
    if isinstance(setting.default, StrEnum):
        return reader.choice(setting.key, setting.default)
    if isinstance(setting.default, str):
        return _read_name(reader, setting.key)
    if isinstance(setting.default, int):
        return reader.number(setting.key, setting.default)
    return reader.duration_s(setting.key, setting.default, least="zero" if setting.may_be_zero else "positive")


def _read_name(reader: Reader, key: str) -> str:
    """Return a name that is declared where it is used; empty if it is not a name."""
    node = reader.scalar(key)
    if node is None or not check_name(node, shown(key), reader.subject, reader.findings, key):
        reader.damage(key)
        return ""
    return node.text


def build_skill(reader: Reader) -> Skill:
    """Return a skill."""
    return Skill(
        name=reader.subject.name,
        place=reader.place,
        **read_preview(reader),
        monitor=tuple(_read_monitor(reader)),
        changes=reader.references("changes"),
        places=reader.places(),
    )


def build_observer(reader: Reader) -> ObserverSetting:
    """Return the settings of an observer."""
    return ObserverSetting(
        name=reader.subject.name,
        place=reader.place,
        identifies=reader.references("identifies"),
        period_s=reader.duration_s("period", 1.0),
        priority=reader.number("priority", 0),
        places=reader.places(),
    )


def build_resource(reader: Reader) -> Resource:
    """Return a resource."""
    slots = reader.number("slots", 0)
    return Resource(name=reader.subject.name, place=reader.place, slots=slots or None)


def _read_call(reader: Reader) -> str:
    node = reader.scalar("call")
    if node is None:
        return ""
    if not _CALL.fullmatch(node.text) or any(keyword.iskeyword(word) for word in re.split(r"[.:]", node.text)):
        reader.fail(
            "call", f"{shown(node.text)} does not name a function of a module", node, _call_help(node.text), "call"
        )
    return node.text


def _call_help(text: str) -> str:
    reserved_word = next((word for word in re.split(r"[.:]", text) if keyword.iskeyword(word)), None)
    if reserved_word is not None:
        return f"{shown(reserved_word)} is a Python keyword and cannot be the name of a module or function"
    correct_call = text.removesuffix("()").replace("/", ".").replace(".py:", ":")
    if ":" not in correct_call:
        correct_call = ":".join(correct_call.rsplit(".", 1))
    return f"did you mean {shown(correct_call)}?" if _CALL.fullmatch(correct_call) else "write package.module:function"


def _read_parameters(reader: Reader) -> Iterable[tuple[str, Literal]]:
    for key, value in entries(reader.node.value("with")):
        if check_name(key, "an argument", reader.subject, reader.findings, "with", key.text):
            yield key.text, read_literal(reader, value, "with", key.text)
        else:
            reader.damage("with")


def _read_uses(reader: Reader) -> Iterable[Usage]:
    for key, value in entries(reader.node.value("uses")):
        access = _ACCESSES.get(value.text) if isinstance(value, ScalarNode) else None
        if access is not None and not (key.reported or value.reported):
            yield Usage(resource=reader.reference(key), access=access, place=reader.origin.of(value))
        else:
            reader.damage("uses")


def _read_returns(reader: Reader) -> Iterable[Returned]:
    first_names: dict[str, str] = {}
    for key, node in entries(reader.node.value("returns")):
        if not check_name(key, "a returned value", reader.subject, reader.findings, "returns"):
            reader.damage("returns")
            continue
        first = first_names.setdefault(key.text.casefold(), key.text)
        if first != key.text:
            message = f"the returned values {shown(first)} and {shown(key.text)} differ only in case"
            reader.fail("duplicate-name", message, key, "rename one of them", "returns", key.text)
        yield _read_returned(reader, key, node)


def _read_returned(reader: Reader, key: ScalarNode, node: YamlNode) -> Returned:
    place, steps = reader.origin.of(key), ("returns", key.text)
    if not isinstance(node, MappingNode):
        reader.damage(*steps)
        return Returned(name=key.text, type=ValueType(kind=Kind.BOOL), optional=False, place=place)
    optional = node.value("optional")
    is_optional = optional is not None and optional.data is True
    return Returned(name=key.text, type=read_type(reader, node, *steps), optional=is_optional, place=place)


def _read_identifies(reader: Reader) -> Iterable[Identification]:
    for key, node in entries(reader.node.value("identifies")):
        if key.reported:
            reader.damage("identifies")
            continue
        steps = ("identifies", key.text)
        yield Identification(variable=reader.reference(key), by=_read_identification(reader, node, *steps))


def _read_identification(reader: Reader, node: YamlNode, *steps: str) -> Condition | Members | Hysteresis:
    if not isinstance(node, MappingNode):
        return read_condition(reader, node, *steps)
    place = reader.origin.of(node)
    if not {"enter", "leave", "confirm"} & node.entries.keys():
        cases = tuple(
            (reader.reference(key), read_condition(reader, value, *steps, key.text))
            for key, value in entries(node)
            if not key.reported
        )
        return Members(cases=cases, place=place)
    enter, leave = node.value("enter"), node.value("leave")
    if enter is None:
        reader.damage(*steps)
    return Hysteresis(
        enter=Condition(text="", tree=None, place=place) if enter is None else read_condition(reader, enter, *steps),
        leave=None if leave is None else read_condition(reader, leave, *steps),
        confirm=_read_confirm(reader, node.value("confirm"), *steps, "confirm"),
        place=place,
    )


def _read_confirm(reader: Reader, node: YamlNode | None, *steps: str) -> tuple[int, int] | None:
    if not isinstance(node, ScalarNode) or node.reported:
        return None
    match = _CONFIRM.fullmatch(node.text)
    required_count, result_count = (int(match[1]), int(match[2])) if match else (0, 0)
    if not 1 <= required_count <= result_count <= MAX_CONFIRMED:
        message = f"{shown(node.text)} is not a valid 'confirm'"
        help_text = f"write for example 2 of 3; at most {MAX_CONFIRMED} results are allowed"
        reader.fail("confirm", message, node, help_text, *steps)
        return None
    return required_count, result_count


def _read_monitor(reader: Reader) -> Iterable[Expectation]:
    for index, item in untorn_items(reader, "monitor"):
        expectation = read_expectation(reader, item, index) if isinstance(item, ScalarNode) else None
        if expectation is not None:
            yield expectation
