"""Findings about the shape of an element: the errors of the schema, one finding per root cause."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from typing import Any

from codra_dsl.language.diagnostics import Fix, Place, is_slip, replacement_fix, surely_means
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.schema.other_forms import (
    REPLACED_KEYS,
    choice_help,
    example_text,
    intended_key,
    lists_without_brackets,
    long_form,
    merged_entries,
    other_form_help,
    set_help,
)
from codra_dsl.language.load.schema.schema import Error, allowed_words, errors_of, has_shape, resolve
from codra_dsl.language.load.schema_file import schema
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.language.load.yaml.fixes import corrected_truth_value, item_removal_fix, suggest_word, trap_fix
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, SequenceNode, Style, YamlNode
from codra_dsl.language.load.yaml.origin import Subject, damaged_key
from codra_dsl.language.load.yaml.traps import (
    Openings,
    Trap,
    read_as_list_trap,
    read_as_literal_trap,
    torn_at_comma_trap,
    torn_condition_trap,
    torn_expectation_trap,
    torn_number_trap,
)

_PART_NOUNS: Mapping[str | int, str] = {
    "returns": "returned value",
    "parameters": "parameter",
    "attributes": "attribute",
    "rules": "rule",
}
"""A mapping from keys to the nouns for their entries, for entries that have names of their own."""

_TRAP_KINDS = {"condition": "condition", "pattern": "condition", "preview": "condition", "expectation": "expectation"}
"""For each anchor in the schema whose values can fall into traps of YAML: the kind of trap."""

_TORN_NUMBER = re.compile(r"[0-9],[0-9]+$")


def explain(
    definition: str, node: YamlNode, subject: Subject, findings: Findings, examples: Mapping[str, object] | None = None
) -> frozenset[str]:
    """Report why an element does not have the shape of a definition: one finding per root cause.

    Misspelt keys are corrected in the nodes, unknown keys are removed, and values with a finding are marked as
    reported. The rest can then be read as intended. `examples` has values for keys of which the schema has no example.

    Returns:
        The keys that cannot be read, as `Spec.damaged_keys` lists them. Misspelt keys can be read. An unknown key may
        mean any absent key, so all absent keys count as unreadable.
    """
    explanation = _Explanation(definition, subject, node, findings, examples or {})
    errors = errors_of(definition, node.data)
    unknown_keys = explanation.unknown_keys(errors)
    for mapping, corrections in unknown_keys:
        _rename(mapping, corrections)
    has_new_errors = any(not mapping.data or any(keys.values()) for mapping, keys in unknown_keys)
    explanation.report(errors_of(definition, node.data) if has_new_errors else errors)
    return frozenset(explanation.damaged)


def explain_outline(definition: str, root: MappingNode, subject: Subject, findings: Findings) -> None:
    """Report mistakes in the keys of a file or template, without checking its sections.

    Misspelt keys are corrected in the nodes; unknown keys stay.
    """
    if has_shape(definition, _outline(root)):
        return
    explanation = _Explanation(definition, subject, root, findings, {})
    for mapping, corrections in explanation.unknown_keys(errors_of(definition, _outline(root))):
        _rename(mapping, {key: known_key or key for key, known_key in corrections.items()})
    errors = errors_of(definition, _outline(root))
    explanation.report(tuple(error for error in errors if error.path or error.keyword != "required"))


def _outline(root: MappingNode) -> dict[str, object]:
    return {key: _outlined(key, value) for key, (_, value) in root.entries.items()}


def _outlined(key: str, value: YamlNode) -> object:
    """Return a section without its elements; the sections under `knowledge` are one level deeper."""
    if key == "parameters" or not isinstance(value, MappingNode):
        return value.data
    return _outline(value) if key == "knowledge" else {}


def _rename(mapping: MappingNode, corrections: Mapping[str, str | None]) -> None:
    """Rename misspelt keys; remove unknown ones."""
    entries = list(mapping.entries.items())
    mapping.entries.clear()
    mapping.data.clear()
    for key, (key_node, value) in entries:
        name = corrections.get(key, key)
        if name is None:
            continue
        if name != key:
            key_node = ScalarNode(name, name, key_node.start, key_node.end, key_node.style)  # noqa: PLW2901
        mapping.put(key_node, value)


class _Explanation:
    """Converts the errors of one element to findings, and lists the keys that they damage."""

    def __init__(
        self, definition: str, subject: Subject, root: YamlNode, findings: Findings, examples: Mapping[str, object]
    ) -> None:
        self._definition, self._subject, self._root = definition, subject, root
        self._findings, self._examples = findings, examples
        self._reported_paths: set[tuple[str | int, ...]] = set()
        self._unmatched_keys: dict[tuple[str | int, ...], list[tuple[ScalarNode, str]]] = {}
        self.damaged: set[str] = set()

    def unknown_keys(self, errors: Iterable[Error]) -> list[tuple[MappingNode, dict[str, str | None]]]:
        """Report unknown keys; return each mapping with unknown keys, with the known key or None for each of them."""
        corrections = []
        for error in errors:
            mapping = self._node(error.path)
            if error.keyword == "additionalProperties" and isinstance(mapping, MappingNode):
                corrections.append((mapping, self._report_unknown_keys(error, mapping)))
        return corrections

    def report(self, errors: Sequence[Error]) -> None:
        """Report the other errors, and unknown keys that may be misspellings of missing keys."""
        for error in errors:
            if error.keyword == "required":
                self._report_missing_keys(error, [other.path for other in errors if other.keyword == "not"])
        for path, keys in self._unmatched_keys.items():
            for key, allowed in keys:
                self._report_key(path, key, allowed)
        for error in errors:
            if error.keyword in ("required", "additionalProperties"):
                continue
            if error.path:
                self.damaged.add(damaged_key(error.path))
            node = self._node(error.path)
            is_emptied = isinstance(node, MappingNode) and node.unread
            if self._is_new(error.path) and not is_emptied:
                self._report_value(error)
            node.reported = True

    def _is_new(self, path: tuple[str | int, ...]) -> bool:
        """Return whether a value and its containers have no finding yet."""
        nodes = list(self._nodes_along(path))
        is_reported = any(node.reported for node in nodes) or any(
            path[:length] in self._reported_paths for length in range(len(path) + 1)
        )
        self._reported_paths.add(path)
        return not is_reported

    def _nodes_along(self, path: Iterable[str | int]) -> Iterator[YamlNode]:
        node: YamlNode | None = self._root
        if node is not None:
            yield node
        for step in path:
            if isinstance(node, MappingNode) and isinstance(step, str):
                node = node.value(step)
            elif isinstance(node, SequenceNode) and isinstance(step, int):
                node = node.items[step]
            if node is not None:
                yield node

    def _node(self, path: Iterable[str | int]) -> YamlNode:
        *_, node = self._nodes_along(path)
        return node

    def _place(self, path: tuple[str | int, ...]) -> Place:
        """Return the place of a value, or of the nearest key around it if the value is long or empty."""
        origin = self._subject.origin
        for length in range(len(path), 0, -1):
            holder, node = self._node(path[: length - 1]), self._node(path[:length])
            if isinstance(holder, MappingNode):
                return origin.of_value(holder.entries[str(path[length - 1])][0], node)
            if node.end > node.start:
                return origin.of(node)
            if isinstance(holder, SequenceNode) and not holder.flow:
                return origin.place(node.start - 1, node.start)  # the dash
        return origin.of_value(self._subject.key, self._root)

    def _mapping_name(self, path: tuple[str | int, ...]) -> str:
        """Return the name of a mapping for messages: the element itself, or a named part of it."""
        if not path:
            return str(self._subject)
        if isinstance(path[-1], int):
            return self._value_name(path)
        if len(path) == 2 and path[0] in _PART_NOUNS:
            return f"{_PART_NOUNS[path[0]]} {shown(str(path[1]))} of {self._subject}"
        return f"{shown(str(path[-1]))} of {self._subject}"

    def _value_name(self, path: tuple[str | int, ...]) -> str:
        """Return the name of a value for messages."""
        if not path or (len(path) == 2 and path[0] in _PART_NOUNS and isinstance(path[1], str)):
            return self._mapping_name(path)
        if isinstance(path[-1], int):
            return f"item {path[-1] + 1} of {self._value_name(path[:-1])}"
        return f"{shown(path[-1])} in {self._mapping_name(path[:-1])}"

    def _report_unknown_keys(self, error: Error, mapping: MappingNode) -> dict[str, str | None]:
        known = error.schema["properties"]
        keys_from_split_values = self._report_torn_keys(mapping)
        keys_from_split_values |= self._report_choice(error.path, mapping, known)
        keys_from_split_values |= self._report_lists(error.path, mapping, known.keys() | keys_from_split_values, known)
        free_keys = {other: None for other in known if other not in mapping.entries}
        corrections: dict[str, str | None] = {}
        for key, (key_node, value) in mapping.entries.items():
            if key in known or key in keys_from_split_values:
                continue
            known_key = intended_key(key, value, free_keys) or self._findings.nearest(key, free_keys)
            known_key = corrections[key] = known_key or long_form(key, free_keys)
            allowed = f"allowed: {', '.join(known)}" if known else "no keys are allowed: write {}"
            fix = (
                self._rename_fix(key_node, known_key, mapping.entries.keys() - known, free_keys) if known_key else None
            )
            free_keys.pop(known_key or "", None)
            self._reported_paths.add((*error.path, known_key or key))
            if known_key:
                self._report_key(error.path, key_node, f"did you mean '{known_key}'?", fix)
            else:
                self._unmatched_keys.setdefault(error.path, []).append((key_node, allowed))
        if keys_from_split_values or None in corrections.values():
            self.damaged.update([damaged_key(error.path)] if error.path else free_keys)
        return corrections

    def _report_choice(self, path: tuple[str | int, ...], mapping: MappingNode, known: Mapping[str, Any]) -> set[str]:
        """Report keys in place of one value, such as `if`, `then` and `else`; return these keys."""
        keys, help_text = choice_help(mapping, known) or set_help(mapping, known) or ((), "")
        if keys:
            self._report_key(path, mapping.entries[keys[0]][0], help_text)
            self._reported_paths.update((*path, key) for key in REPLACED_KEYS)
        return set(keys)

    def _report_lists(
        self, path: tuple[str | int, ...], mapping: MappingNode, explained_keys: Set[str], known: Mapping[str, Any]
    ) -> set[str]:
        """Report lists without brackets in a mapping in braces; return the keys that are items of these lists."""
        all_item_keys: set[str] = set()
        for list_key, item_keys in lists_without_brackets(mapping, explained_keys, known):
            value = mapping.entries[list_key][1]
            first_item = value.text if isinstance(value, ScalarNode) else ""
            self._report_key(
                path, mapping.entries[item_keys[0]][0], f"write '{list_key}: [{', '.join((first_item, *item_keys))}]'"
            )
            value.reported = True
            self.damaged.add(damaged_key((*path, list_key)))
            all_item_keys.update(item_keys)
        return all_item_keys

    def _report_key(self, path: tuple[str | int, ...], key: ScalarNode, help_text: str, fix: Fix | None = None) -> None:
        message = f"unknown key {shown(key.written)} in {self._mapping_name(path)}"
        place, key_path = self._subject.origin.of(key), self._subject.part(*path, key.text)
        self._findings.add("unknown-key", message, place, help=help_text, path=key_path, fix=fix)

    def _rename_fix(
        self, key: ScalarNode, suggestion: str, other_keys: Iterable[str], free_keys: Iterable[str]
    ) -> Fix | None:
        """Return the fix of a misspelt key. It is safe if the meaning is unique and no other key has this meaning."""
        is_unique = not any(is_slip(other, suggestion) for other in other_keys if other != key.text)
        is_safe = is_unique and surely_means(key.text, suggestion, free_keys)
        return replacement_fix(self._subject.origin.of(key), key.written, suggestion, safe=is_safe)

    def _report_missing_keys(self, error: Error, misplaced_paths: Sequence[tuple[str | int, ...]]) -> None:
        mapping = self._node(error.path)
        if not isinstance(mapping, MappingNode) or mapping.reported:
            return
        missing_keys = [key for key in error.limit if key not in mapping.entries]
        unmatched_keys = self._unmatched_keys.get(error.path, [])
        for key in missing_keys:
            path = (*error.path, key)
            self.damaged.add(damaged_key(path))
            if path in self._reported_paths or mapping.unread:
                continue
            self._reported_paths.add(path)
            replaced_paths = [misplaced for misplaced in misplaced_paths if misplaced[:-1] == error.path]
            if len(unmatched_keys) == len(missing_keys) == 1:
                self._report_key(error.path, unmatched_keys.pop()[0], f"did you mean '{key}', which is missing?")
            elif len(replaced_paths) == len(missing_keys) == 1:
                self._report_replaced_key(replaced_paths[0], key)
            elif not self._report_text_with_key(error.path, mapping, key):
                self._report_missing_key(error, key)

    def _report_missing_key(self, error: Error, key: str) -> None:
        self._findings.add(
            "missing-key",
            f"{shown(key)} is missing in {self._mapping_name(error.path)}",
            self._place_of_name(error.path),
            help=f"add it, for example {example_text(key, self._subschema(error, key))}",
            path=self._subject.part(*error.path, key),
        )

    def _report_replaced_key(self, path: tuple[str | int, ...], missing_key: str) -> None:
        """Report a key that is not allowed in its mapping, and was probably meant as a missing key."""
        message = f"{self._value_name(path)} is not allowed here"
        help_text, key_path = f"did you mean '{missing_key}', which is missing?", self._subject.part(*path)
        self._findings.add("misplaced-key", message, self._place_of_name(path), help=help_text, path=key_path)
        self._reported_paths.add(path)

    def _report_text_with_key(self, path: tuple[str | int, ...], mapping: MappingNode, missing_key: str) -> bool:
        """Report a text with a missing key and its value, such as `door over 20 s`; return whether there is one."""
        for key, (key_node, value) in mapping.entries.items():
            parts = merged_entries(value, missing_key) if isinstance(value, ScalarNode) else None
            if parts is None:
                continue
            text, missing_text = parts
            message = f"{self._value_name((*path, key))} contains the value of {shown(missing_key)}"
            help_text = f"write '{key}: {text}' and '{missing_key}: {missing_text}'"
            place = self._subject.origin.of_value(key_node, value)
            self._findings.add("missing-key", message, place, help=help_text, path=self._subject.part(*path, key))
            value.reported = True
            self.damaged.add(damaged_key((*path, key)))
            return True
        return False

    def _subschema(self, error: Error, key: str) -> dict[str, Any]:
        """Return the schema of a missing key. An `if` of the schema can require a key that is described elsewhere."""
        property_schema = error.schema.get("properties", {}).get(key)
        if key == "type" and isinstance(error.data, dict) and "values" in error.data:
            return {"examples": ["enum"]}
        definition = schema()["$defs"].get(self._definition, {})
        return resolve(property_schema or definition.get("properties", {}).get(key, {}))

    def _place_of_name(self, path: tuple[str | int, ...]) -> Place:
        if not path:
            return self._subject.origin.of(self._subject.key)
        holder = self._node(path[:-1])
        if isinstance(holder, MappingNode):
            return self._subject.origin.of(holder.entries[str(path[-1])][0])
        return self._place(path)

    def _report_value(self, error: Error) -> None:
        if error.schema.get("$anchor") in _TRAP_KINDS and self._report_trap(error):
            return
        path = error.path
        if error.keyword == "uniqueItems":
            path = (*path, _repeated_index(error.data))
        rule, message, help_text = self._describe_error(error, self._node(path))
        place = self._place_of_name(path) if rule == "misplaced-key" else self._place(path)
        fix = self._fix(rule, error, path)
        self._findings.add(rule, message, place, help=help_text, path=self._subject.part(*error.path), fix=fix)

    def _fix(self, rule: str, error: Error, path: tuple[str | int, ...]) -> Fix | None:
        """Return the fix of a wrong value, if its meaning is clear."""
        node, holder = self._node(path), self._node(path[:-1])
        if rule == "repeated-value" and isinstance(holder, SequenceNode):
            return item_removal_fix(holder, int(path[-1]), self._subject.origin)
        if not isinstance(node, ScalarNode) or node.style is not Style.PLAIN:
            return None
        if rule == "unknown-value":
            word, safe = self._intended_word(path, node.text, allowed_words(error.schema))
        else:
            is_truth = rule == "wrong-type" and error.schema.get("title") == "true or false"
            word, safe = (corrected_truth_value(node.text) if is_truth else None), True
        return None if word is None else replacement_fix(self._subject.origin.of(node), node.text, word, safe=safe)

    def _intended_word(self, path: tuple[str | int, ...], word: str, allowed: Sequence[str]) -> tuple[str | None, bool]:
        """Return the allowed word that is meant, or None, and whether it is certain. A type with `values` is `enum`."""
        holder = self._node(path[:-1])
        if path[-1:] == ("type",) and isinstance(holder, MappingNode) and "values" in holder.entries:
            return "enum", surely_means(word, "enum", ())
        return suggest_word(word, allowed, self._findings)

    def _describe_error(self, error: Error, node: YamlNode) -> tuple[str, str, str]:
        """Return rule, message and help for a wrong value."""
        value_name = self._value_name(error.path)
        title = error.schema.get("title", "something else") if error.path else "a mapping"
        title += "" if error.mapping_example is None else " or a mapping"
        key = error.path[-1] if error.path else self._subject.key.written
        known_example = error.mapping_example or (self._examples.get(str(key)) if error.path else None)
        examples = {} if known_example is None else {"examples": [known_example]}
        example = f"for example {example_text(key, error.schema | examples)}"
        if str(key) in error.schema.get("properties", ()):
            example = "indent it further, as a key of the element above"
        if error.keyword == "not":
            reason = error.schema["description"]
            return (
                "misplaced-key",
                f"{value_name} is not allowed here: {reason}",
                f"remove {shown(str(key))}, or change the element so that it may have this key",
            )
        if error.keyword == "uniqueItems":
            return "repeated-value", f"{_describe(node)} occurs twice in {value_name}", "remove one of them"
        if error.keyword in ("minItems", "maxItems", "minLength", "minProperties"):
            message = f"{value_name} must be {title}, not {_describe(node)}" if error.data else f"{value_name} is empty"
            return "wrong-length", message, example
        allowed = allowed_words(error.schema)
        if allowed and isinstance(error.data, str):
            suggestion, _ = self._intended_word(error.path, error.data, allowed)
            choices = [word for word in allowed if word in title.split()] or allowed
            mapping_help = "" if error.mapping_example is None else f", or {example}"
            help_text = f"allowed: {', '.join(choices)}{mapping_help}"
            help_text = f"did you mean '{suggestion}'?" if suggestion else help_text
            return "unknown-value", f"{value_name} cannot be {shown(error.data)}", help_text
        if isinstance(node, ScalarNode) and not node.text:
            return "wrong-type", f"{value_name} has no value; it must be {title}", example
        return (
            "wrong-type",
            f"{value_name} must be {title}, not {_describe(node)}",
            other_form_help(self._subject, error, node, self._node(error.path[:-1]), title) or example,
        )

    def _report_trap(self, error: Error) -> bool:
        """Report the trap of YAML that caused an error in a condition; return whether there is one."""
        node = self._node(error.path)
        holder = self._node(error.path[:-1])
        if isinstance(holder, MappingNode) and error.path[-1] in self._report_torn_keys(holder):
            return True
        trap = self._trap_of(error.path, node, _TRAP_KINDS[error.schema["$anchor"]])
        if trap is None:
            return False
        origin = self._subject.origin
        path = self._subject.part(*error.path)
        fix = trap_fix(trap, origin.of(node))
        self._findings.add(trap.rule, trap.message, origin.of(node), help=trap.help, path=path, fix=fix)
        return True

    def _trap_of(self, path: tuple[str | int, ...], node: YamlNode, trap_kind: str) -> Trap | None:
        written = self._subject.origin.written(node)
        if isinstance(node, ScalarNode):
            if trap_kind != "condition" or node.data is None:
                return None
            holder, index = self._node(path[:-1]), path[-1]
            if isinstance(holder, SequenceNode) and isinstance(index, int) and index > 0:
                number = self._subject.origin.source.text[holder.items[index - 1].start : node.end]
                if _TORN_NUMBER.search(number):
                    return torn_number_trap(number)
            return read_as_literal_trap(node.text, f"a {_kind(node.data)}", str(path[0]))
        if written.startswith(("{", "[")):
            return None
        if isinstance(node, SequenceNode):
            return read_as_list_trap(written)
        return torn_condition_trap(written) if trap_kind == "condition" else torn_expectation_trap(written)

    def _report_torn_keys(self, mapping: MappingNode) -> set[str]:
        """Return the keys of a mapping in braces that are pieces of a split condition, which is reported once."""
        keys_from_split_values: dict[str, ScalarNode] = {}
        first_piece: ScalarNode | None = None
        openings = Openings("")
        for key, (key_node, value) in mapping.entries.items() if mapping.flow else ():
            text = value.text if isinstance(value, ScalarNode) else ""
            if first_piece is None:
                openings = Openings(text)
                first_piece = value if openings.is_any_open and isinstance(value, ScalarNode) else None
                continue
            keys_from_split_values[key] = key_node
            openings.read(f", {key_node.text}")
            if not openings.is_any_open:
                self._report_torn_condition(first_piece, max(key_node.end, value.end))
                first_piece = None
        if first_piece is not None:
            return set()
        for key_node in keys_from_split_values.values():
            key_node.reported = True
        return set(keys_from_split_values)

    def _report_torn_condition(self, first_piece: ScalarNode, end: int) -> None:
        place = self._subject.origin.place(first_piece.start, end)
        trap = torn_at_comma_trap(self._subject.origin.source.text[first_piece.start : end])
        if not first_piece.reported:
            fix = trap_fix(trap, place)
            self._findings.add(trap.rule, trap.message, place, help=trap.help, path=self._subject.part(), fix=fix)
        first_piece.reported = True


def _repeated_index(items: Sequence[object]) -> int:
    """Return the index of the first item that repeats an earlier one."""
    seen_texts: set[str] = set()
    for index, item in enumerate(items):
        item_text = f"{type(item).__name__} {item}"
        if item_text in seen_texts:
            return index
        seen_texts.add(item_text)
    return 0


def _describe(node: YamlNode) -> str:
    """Return a description of a node for messages."""
    if isinstance(node, MappingNode):
        return "a mapping" if node.entries else "an empty mapping"
    if isinstance(node, SequenceNode):
        return f"a list of {len(node.items)}" if len(node.items) != 0 else "an empty list"
    if isinstance(node.data, str):
        return f"the text {shown(node.text)}" if node.text else "an empty text"
    return f"the {_kind(node.data)} {shown(node.text)}" if node.text else "nothing"


def _kind(data: object) -> str:
    if isinstance(data, bool):
        return "truth value"
    return "empty value" if data is None else "number"
