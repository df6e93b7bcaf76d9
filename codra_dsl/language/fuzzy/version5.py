"""Convert definitions of FuzzyLite 5 to version 6, which has other words for operators.

| version 5 | version 6 |
| --- | --- |
| `accumulation: S` | `aggregation: S` |
| `lock-valid: true` (4 and 5) | `lock-previous: true` |
| `activation: T`, where T is a norm | `implication: T` and `activation: General` |
| `activation: none` | `activation: General` |
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from codra_dsl.language.fuzzy.source import Findings, Line, Word
from codra_dsl.language.fuzzy.words import Method, TNorm

_NEW_KEYS = {"accumulation": "aggregation", "lock-valid": "lock-previous"}
_NORMS = frozenset(TNorm)
_NO_NORM = ("", "none")


def convert_from_version_5(definitions: Iterable[Line], findings: Findings) -> list[Line]:
    """Return definitions in the words of version 6, at the places of the original ones. Report a file of version 5.

    A file with an implication is of version 6, because version 5 has none.
    """
    lines = list(definitions)
    old_lines = [line for line in lines if line.key.text in _NEW_KEYS or _has_norm_as_activation(line)]
    if not old_lines or any(line.key.text == "implication" for line in lines):
        return lines
    replacements = dict.fromkeys(_replacement_text(line) for line in old_lines)
    findings.add(
        "fll-version-5",
        "an engine of FuzzyLite 5: it is read as if it were converted to version 6",
        old_lines[0].key.place,
        f"in version 6, write {'; '.join(replacements)}",
    )
    return [new_line for line in lines for new_line in _converted(line)]


def _has_norm_as_activation(line: Line) -> bool:
    return line.key.text == "activation" and line.value.text in _NORMS


def _replacement_text(line: Line) -> str:
    key, norm = line.key.text, line.value.text
    if key in _NEW_KEYS:
        return f"'{_NEW_KEYS[key]}' for '{key}'"
    return f"'implication: {norm}' and 'activation: {Method.GENERAL}' for 'activation: {norm}'"


def _converted(line: Line) -> Iterator[Line]:
    key, value = line.key, line.value
    if key.text in _NEW_KEYS:
        yield Line(Word(_NEW_KEYS[key.text], key.place), value)
    elif key.text == "activation" and value.text in (*_NORMS, *_NO_NORM):
        if value.text in _NORMS:
            yield Line(Word("implication", key.place), value)
        yield Line(key, Word(Method.GENERAL.value, value.place))
    else:
        yield line
