"""Help for values that are written in another form than their key needs, if their meaning is clear."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence

from codra_dsl.language.expression import And, Compare, In, Not, Or, parse_derivation
from codra_dsl.language.load.schema.schema import Error
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, SequenceNode, Style, YamlNode
from codra_dsl.language.load.yaml.origin import Subject
from codra_dsl.language.load.yaml.traps import is_derivation, quote_text
from codra_dsl.language.units import duration_help

CHOICE_KEYS = ("if", "then", "else")
"""The keys over which a choice is spread in other languages."""

_MEANT_KEYS = {
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

_ITEMS = re.compile(r"[\[(]?([^\[\](){}\"'#:]+)[\])]?")


def other_form_help(subject: Subject, error: Error, node: YamlNode, holder: YamlNode, title: str) -> str | None:
    """Return the help for a value of the wrong form in an element, if its meaning is clear.

    `holder` contains the value, and `title` is what its key needs.
    """
    if isinstance(node, MappingNode | SequenceNode) and len(node.data) > MAX_ENTRIES:
        return None
    if not error.path and subject.section == "context" and isinstance(node, ScalarNode):
        is_truth = isinstance(parse_derivation(node.text), And | Or | Not | Compare | In)
        return f"write '{subject.key.written}: {{type: bool, derived: {node.text}}}'" if is_truth else None
    if title == "a condition" and isinstance(node, SequenceNode):
        is_single = isinstance(error.path[-1], str)
        return f"{'write one' if is_single else 'write each as an item of its own'}, or join them with 'and' or 'or'"
    if title == "an expression over context":
        return _expression_help(node, holder)
    if title == "a condition" and isinstance(node, MappingNode) and error.path == ("value",):
        return _choices_help("value", node)
    if title == "a rule" and isinstance(node, MappingNode):
        return _rule_help(node)
    if title in ("a list of conditions", "a list of names and conditions") and isinstance(node, MappingNode):
        comparisons = _comparisons(node)
        return f"write '{error.path[-1]}: [{comparisons}]'" if comparisons else None
    if title == "a type" and isinstance(node, SequenceNode):
        return f"write 'type: enum' and 'values: {literal_text(error.data)}'"
    if not isinstance(node, ScalarNode) or not isinstance(node.data, (str, int, float)):
        return None
    if title.startswith("a duration"):
        return duration_help(node.text, "forever" if "forever" in title else "finite")
    if not title.startswith("a list of ") or title.endswith("numbers"):
        return None
    if node.text.startswith("-"):
        return "write a blank after the '-' of each item"
    is_on_one_line = node.style is not Style.PLAIN or node.end - node.start == len(node.text)
    items = _ITEMS.fullmatch(node.text) if is_on_one_line else None
    return (
        "begin each item with '- ' on a line of its own" if items is None else f"write '{error.path[-1]}: [{items[1]}]'"
    )


def meant_key(key: str, value: YamlNode, free_keys: Collection[str]) -> str | None:
    """Return the free key that a key of another language means, or None."""
    known_key = _MEANT_KEYS.get(key)
    is_text = isinstance(value, ScalarNode) and isinstance(value.data, str)
    return known_key if known_key in free_keys and (is_text or known_key == "preview") else None


def choice_help(mapping: MappingNode, known_keys: Collection[str]) -> str | None:
    """Return the help for a choice that is spread over the keys `if`, `then` and `else`, or None."""
    texts = [value.text for key in CHOICE_KEYS if isinstance(value := mapping.value(key), ScalarNode)]
    target = next((key for key in ("value", "derived") if key in known_keys), None)
    if target is None or len(texts) < len(CHOICE_KEYS) or "if" in known_keys:
        return None
    condition, then, otherwise = texts
    return f"write '{target}: {then} if {condition} else {otherwise}'"


def literal_text(value: object) -> str:
    """Return a value as YAML on one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {literal_text(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(literal_text, value)) + "]"
    return str(value).lower() if isinstance(value, bool) else str(value)


def _expression_help(node: YamlNode, holder: YamlNode) -> str | None:
    """Return the help for conditions in a list or a mapping, as they stand under other keys."""
    if isinstance(node, SequenceNode):
        conditions = _conditions(node.items)
        return f"write 'derived: {' and '.join(conditions)}'" if conditions else None
    if not isinstance(node, MappingNode):
        return None
    conditions = _conditions([value for _, value in node.entries.values()])
    if "enter" in node.entries and conditions:
        return f"write one condition: 'derived: {conditions[0]}'; 'enter' and 'leave' are allowed only in 'identifies'"
    members = _members(holder)
    if len(members) < 2:
        return None
    if len(conditions) < 2 or not set(members) >= node.entries.keys():
        expression = f'"{members[0]}" if CONDITION else "{members[1]}"'
    else:
        *others, last = node.entries
        choices = [f'"{member}" if {condition} else ' for member, condition in zip(others, conditions, strict=False)]
        expression = "".join((*choices, f'"{last}"'))
    return f"write derived: {quote_text(expression)}"


def _choices_help(key: str, node: MappingNode) -> str | None:
    """Return the help for a mapping from values to conditions."""
    conditions = _conditions([value for _, value in node.entries.values()])
    if len(conditions) < 2:
        return None
    *others, last = node.entries
    choices = (f"{value} if {condition} else " for value, condition in zip(others, conditions, strict=False))
    return f"write '{key}: {''.join(choices)}{last}'"


def _rule_help(node: MappingNode) -> str | None:
    """Return the help for `if ANTECEDENT: TERM` and for `{if: ANTECEDENT, then: TERM}`."""
    texts = {key: value.text for key, (_, value) in node.entries.items() if isinstance(value, ScalarNode)}
    if texts.keys() == {"if", "then"}:
        return f"write 'if {texts['if']} then {texts['then']}'"
    antecedent, conclusion = next(iter(texts.items()), ("", ""))
    is_rule = len(node.entries) == 1 and antecedent.startswith("if ")
    return f"write '{antecedent} then {conclusion}'" if is_rule else None


def _comparisons(node: MappingNode) -> str:
    """Return the entries of a mapping as comparisons, such as `door == "open"`; empty if they are none."""
    texts = [
        f'{key} == "{value.text}"' if isinstance(value.data, str) else f"{key} == {value.text}"
        for key, (_, value) in node.entries.items()
        if isinstance(value, ScalarNode)
    ]
    return ", ".join(texts) if len(texts) == len(node.entries) and all(map(is_derivation, texts)) else ""


def _members(holder: YamlNode) -> list[str]:
    """Return the values of an enum, as far as they can be read."""
    values = holder.value("values") if isinstance(holder, MappingNode) else None
    items = values.items if isinstance(values, SequenceNode) else ()
    return [item.text for item in items if isinstance(item, ScalarNode)]


def _conditions(nodes: Sequence[YamlNode]) -> list[str]:
    """Return the texts of nodes if all of them are conditions; otherwise nothing."""
    texts = [node.text for node in nodes if isinstance(node, ScalarNode)]
    return texts if len(texts) == len(nodes) and all(map(is_derivation, texts)) else []
