"""Convert definitions of FuzzyLite 5 to version 6, which has other words for operators.

| version 5 | version 6 |
| --- | --- |
| `accumulation: S` | `aggregation: S` |
| `lock-valid: true` (4 and 5) | `lock-previous: true` |
| `activation: T`, where T is a norm | `implication: T` and `activation: General` |
| `activation: none`, or no activation | `activation: General` |

Public files also have `accumulation` beside the `implication` of version 6.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from codra_dsl.language.fuzzy.source import Findings, Line, Word
from codra_dsl.language.fuzzy.words import Method, TNorm

_NEW_KEYS = {"accumulation": "aggregation", "lock-valid": "lock-previous"}
_HEADS = ("Engine", "InputVariable", "OutputVariable", "RuleBlock")
_NO_NORM = ("", "none")


def convert_from_version_5(definitions: Iterable[Line], findings: Findings) -> list[Line]:
    """Return definitions in the words of version 6, at the places of the original ones. Report a file of version 5.

    A norm as activation is a mistake in a file that also has an implication, which version 5 does not have.
    """
    lines = list(definitions)
    has_implication = any(line.key.text == "implication" for line in lines)
    norms_as_activation = () if has_implication else tuple(TNorm)
    old_lines = [
        line
        for line in lines
        if line.key.text in _NEW_KEYS or (line.key.text == "activation" and line.value.text in norms_as_activation)
    ]
    if not old_lines:
        return lines
    replacements = dict.fromkeys(_replacement_text(line) for line in old_lines)
    findings.add(
        "fll-version-5",
        "an engine of FuzzyLite 5: it is read as if it were converted to version 6",
        old_lines[0].key.place,
        f"in version 6, write {'; '.join(replacements)}",
    )
    return [new_line for line in _with_activations(lines) for new_line in _converted(line, norms_as_activation)]


def _replacement_text(line: Line) -> str:
    key, norm = line.key.text, line.value.text
    if key in _NEW_KEYS:
        return f"'{_NEW_KEYS[key]}' for '{key}'"
    return f"'implication: {norm}' and 'activation: {Method.GENERAL}' for 'activation: {norm}'"


def _with_activations(lines: list[Line]) -> Iterator[Line]:
    """Yield definitions; a block without activation gets an empty one."""
    block: Line | None = None
    for line in lines:
        if line.key.text in _HEADS:
            if block is not None:
                yield _empty_activation(block)
            block = line if line.key.text == "RuleBlock" else None
        elif line.key.text == "activation":
            block = None
        yield line
    if block is not None:
        yield _empty_activation(block)


def _empty_activation(block: Line) -> Line:
    return Line(Word("activation", block.key.place), Word("", block.key.place))


def _converted(line: Line, norms_as_activation: tuple[str, ...]) -> Iterator[Line]:
    key, value = line.key, line.value
    if key.text in _NEW_KEYS:
        yield Line(Word(_NEW_KEYS[key.text], key.place), value)
    elif key.text == "activation" and value.text in (*norms_as_activation, *_NO_NORM):
        if value.text not in _NO_NORM:
            yield Line(Word("implication", key.place), value)
        yield Line(key, Word(Method.GENERAL.value, value.place))
    else:
        yield line
