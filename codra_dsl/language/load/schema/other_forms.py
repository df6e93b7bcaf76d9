"""Help for values that are written in another form than their key needs, if their meaning is clear."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence, Set
from typing import Any

from codra_dsl.language.expression import And, Compare, In, Not, Or, is_name, parse_derivation
from codra_dsl.language.load.schema.schema import Error, resolve
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, SequenceNode, Style, YamlNode
from codra_dsl.language.load.yaml.origin import Subject
from codra_dsl.language.load.yaml.traps import is_derivation, quote_text
from codra_dsl.language.units import duration_help, parse_duration

CHOICE_KEYS = ("if", "then", "else")
"""The keys over which a choice is spread in other languages."""

REPLACED_KEYS = ("value", "derived", "set", "choose", "in", "otherwise")
"""The keys that `choice_help` and `set_help` replace by other keys."""

_INTENDED_KEYS = {
    **dict.fromkeys(("value", "expression", "expr", "formula", "condition", "computed", "derived_from"), "derived"),
    **dict.fromkeys(("else", "default", "fallback"), "otherwise"),
    **dict.fromkeys(("variable", "target", "parameter"), "set"),
    **dict.fromkeys(("pre", "precondition", "preconditions", "requires", "needs"), "preview"),
    "rate": "rate_of",
    "share": "share_of",
}
"""A mapping from keys of other languages to keys of this language."""

MAX_ENTRIES = 20
"""The maximum number of entries of a mapping or a list that the help repeats."""

_MERGED_ENTRIES = re.compile(r"(?P<name>[A-Za-z]\w*),?\s+(?P<key>[a-z_]+):?\s+(?P<rest>.+)", re.ASCII)
_CONSTRAINT = re.compile(r"if\s+(?P<condition>[^,{}]+?)\s+then\s+(?P<consequence>[^,{}]+)")
_MIN_SHORT_FORM_LENGTH = 5
_ITEMS = re.compile(r"[\[(]?([^\[\](){}\"'#:]+)[\])]?")


def other_form_help(subject: Subject, error: Error, node: YamlNode, holder: YamlNode, title: str) -> str | None:
    """Return the help for a value of the wrong form in an element, if its meaning is clear.

    `holder` contains the value, and `title` is what its key needs.
    """
    key = str(error.path[-1]) if error.path else subject.key.written
    if isinstance(node, ScalarNode):
        return _text_help(node, key, title if error.path else subject.section)
    if len(node.data) > MAX_ENTRIES:
        return None
    texts = _texts(node)
    conditions = texts if all(map(is_derivation, texts.values())) else {}
    match title, node:
        case "a condition", SequenceNode():
            is_item = isinstance(error.path[-1], int)
            return f"{'write each as an item of its own' if is_item else 'write one'}, or join them with 'and' or 'or'"
        case "an expression over context", SequenceNode() if conditions:
            return f"write 'derived: {' and '.join(conditions.values())}'"
        case "an expression over context", MappingNode() if "enter" in conditions:
            help = f"write one condition: 'derived: {conditions['enter']}'"
            return f"{help}; 'enter' and 'leave' are allowed only in 'identifies'"
        case "an expression over context", MappingNode() if len(members := _members(holder)) > 1:
            is_complete = len(conditions) > 1 and conditions.keys() <= set(members)
            choices = conditions if is_complete else dict.fromkeys(members[:2], "CONDITION")
            expression = _choice({f'"{value}"': text for value, text in choices.items()})
            return f"write derived: {quote_text(expression)}"
        case "a condition", MappingNode() if error.path == ("value",) and len(conditions) > 1:
            return f"write 'value: {_choice(conditions)}'"
        case "a rule", MappingNode():
            return _rule_help(texts)
        case "a name or a condition", MappingNode() if comparisons := _comparisons(node):
            return f"write '{comparisons}'"
        case "a list of conditions" | "a list of names and conditions", MappingNode():
            comparisons = _comparisons(node)
            return f"write '{key}: [{comparisons}]'" if comparisons else None
        case "a type", SequenceNode():
            return f"write 'type: enum' and 'values: {literal_text(error.data)}'"
        case _, MappingNode() if node.entries and title.startswith("a list of "):
            has_names = resolve(error.schema.get("items", {})).get("type") == "string"
            return f"write '{key}: [{', '.join(node.entries) if has_names else literal_text(error.data)}]'"
        case _, SequenceNode() if node.items and all(isinstance(item, MappingNode) for item in node.items):
            entries = {name: value for item in error.data for name, value in item.items()}
            return f"write '{key}: {literal_text(entries)}'"
        case _, SequenceNode() if len(texts) == 1 and not title.startswith("a mapping"):
            return f"write '{texts['0']}'" if key.isdigit() else f"write '{key}: {texts['0']}'"
    return None


def intended_key(key: str, value: YamlNode, free_keys: Collection[str]) -> str | None:
    """Return the free key that a key of another language means, or None."""
    known_key = _INTENDED_KEYS.get(key)
    is_text = isinstance(value, ScalarNode) and isinstance(value.data, str)
    return known_key if known_key in free_keys and (is_text or known_key == "preview") else None


def merged_entries(value: ScalarNode, key: str) -> tuple[str, str] | None:
    """Return the two parts of a text that contains another key and its value, such as `door over 20 s`, or None."""
    parts = _MERGED_ENTRIES.fullmatch(value.text)
    if parts is None or (parts["key"] != key and parse_duration(parts["rest"]) is None):
        return None
    return parts["name"], parts["rest"]


def long_form(key: str, candidates: Iterable[str]) -> str | None:
    """Return the only candidate of which a key is a short form, such as `params` for `parameters`."""
    longer_names = [
        other for other in candidates if len(key) >= _MIN_SHORT_FORM_LENGTH and other.startswith(key.removesuffix("s"))
    ]
    return longer_names[0] if len(longer_names) == 1 else None


def lists_without_brackets(
    mapping: MappingNode, explained_keys: Set[str], known: Mapping[str, Any]
) -> Iterator[tuple[str, list[str]]]:
    """Yield each key whose list lacks brackets, such as `source: a, b` in braces, and the keys that are its items."""
    list_key, item_keys = "", list[str]()
    for key, (_, value) in (*mapping.entries.items(), ("", (None, None))) if mapping.flow else ():
        if key and key not in explained_keys and isinstance(value, ScalarNode) and value.data is None:
            item_keys.append(key)
            continue
        if item_keys and "a list of" in resolve(known.get(list_key, {})).get("title", ""):
            yield list_key, item_keys
        list_key, item_keys = key, []


def choice_help(mapping: MappingNode, known_keys: Collection[str]) -> tuple[Sequence[str], str] | None:
    """Return the keys and the help for a choice that is spread over the keys `if`, `then` and `else`, or None."""
    texts = _texts(mapping)
    target = next((key for key in ("value", "derived") if key in known_keys), None)
    if target is None or "if" in known_keys or not texts.keys() >= set(CHOICE_KEYS):
        return None
    return CHOICE_KEYS, f"write '{target}: {texts['then']} if {texts['if']} else {texts['else']}'"


def set_help(mapping: MappingNode, known_keys: Collection[str]) -> tuple[Sequence[str], str] | None:
    """Return the key and the help for a variable that an adaptation sets as `VARIABLE: VALUE`, or None."""
    is_adaptation = {"set", "choose"} <= {*known_keys}
    unknown_keys = [key for key in mapping.entries if key not in known_keys]
    if not is_adaptation or len(unknown_keys) != 1 or not {"set", "value", "choose", "in"}.isdisjoint(mapping.entries):
        return None
    name, value = unknown_keys[0], mapping.entries[unknown_keys[0]][1]
    if not is_name(name) or not isinstance(value, ScalarNode) or not is_derivation(value.text):
        return None
    return unknown_keys, f"write 'set: {name}' and 'value: {value.text}'"


def example_text(key: str | int, subschema: Mapping[str, Any]) -> str:
    """Return the first example of a schema, with its key unless it is an item of a list."""
    example = literal_text(subschema["examples"][0]) if "examples" in subschema else "..."
    return f"'{example}'" if isinstance(key, int) else f"'{key}: {example}'"


def literal_text(value: object) -> str:
    """Return a value as YAML on one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {literal_text(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(literal_text, value)) + "]"
    return str(value).lower() if isinstance(value, bool) else str(value)


def _text_help(node: ScalarNode, key: str, title: str) -> str | None:
    """Return the help for a text in place of a mapping or a list, and for a text that is not a duration."""
    if title == "context":
        is_truth = isinstance(parse_derivation(node.text), And | Or | Not | Compare | In)
        return f"write '{key}: {{type: bool, derived: {node.text}}}'" if is_truth else None
    if title.startswith("a rule, {if") and (rule := _CONSTRAINT.fullmatch(node.text)):
        return f"write '{{if: {rule['condition']}, then: {rule['consequence']}}}'"
    if not isinstance(node.data, (str, int, float)):
        return None
    if title.startswith("a duration"):
        return duration_help(node.text, "forever" if "forever" in title else "finite")
    if not title.startswith("a list of ") or title.endswith("numbers"):
        return None
    if node.text.startswith("-"):
        return "write a blank after the '-' of each item"
    is_on_one_line = node.style is not Style.PLAIN or node.end - node.start == len(node.text)
    items = _ITEMS.fullmatch(node.text) if is_on_one_line else None
    text = node.text if "condition" in title and is_derivation(node.text) else items and items[1]
    return f"write '{key}: [{text}]'" if text else "begin each item with '- ' on a line of its own"


def _texts(node: MappingNode | SequenceNode) -> Mapping[str, str]:
    """Return the texts in a mapping or a list by key or index; nothing if it contains anything else."""
    if isinstance(node, SequenceNode):
        values = {str(index): item for index, item in enumerate(node.items)}
    else:
        values = {key: value for key, (_, value) in node.entries.items()}
    texts = {key: value.text for key, value in values.items() if isinstance(value, ScalarNode)}
    return texts if len(texts) == len(values) else {}


def _choice(conditions: Mapping[str, str]) -> str:
    """Return the expression for a mapping from values to conditions."""
    *others, last = conditions
    return "".join(f"{value} if {conditions[value]} else " for value in others) + last


def _rule_help(texts: Mapping[str, str]) -> str | None:
    """Return the help for `if ANTECEDENT: TERM` and for `{if: ANTECEDENT, then: TERM}`."""
    if texts.keys() == {"if", "then"}:
        return f"write 'if {texts['if']} then {texts['then']}'"
    antecedent, conclusion = next(iter(texts.items()), ("", ""))
    if len(texts) != 1 or not antecedent.startswith("if "):
        return None
    return f"write '{antecedent.partition(' then ')[0]} then {conclusion}'"


def _comparisons(node: MappingNode) -> str:
    """Return the entries of a mapping as comparisons, such as `door == "open"`; empty if they are not comparisons."""
    texts = [
        f'{key} == "{value.text}"' if is_name(value.text) else f"{key} == {value.text}"
        for key, (_, value) in node.entries.items()
        if isinstance(value, ScalarNode)
    ]
    return ", ".join(texts) if len(texts) == len(node.entries) and all(map(is_derivation, texts)) else ""


def _members(holder: YamlNode) -> list[str]:
    """Return the values of an enum, as far as they can be read."""
    values = holder.value("values") if isinstance(holder, MappingNode) else None
    return list(_texts(values).values()) if isinstance(values, SequenceNode) else []
