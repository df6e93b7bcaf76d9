"""Which names a spec may declare."""

from __future__ import annotations

import keyword
import re

from codra_dsl.expression import FUNCTIONS
from codra_dsl.expression.tokens import shown
from codra_dsl.load.findings import Findings
from codra_dsl.load.nodes import ScalarNode
from codra_dsl.load.origin import Subject

MAX_NAME = 100
"""The longest name: it becomes part of file names."""

_IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_LITERALS = frozenset({"true", "false", "null"})
_RESERVED = frozenset({*keyword.kwlist, *FUNCTIONS, *_LITERALS})
_OTHER_PARAMETER = re.compile(r"\$\{(\w+)\}|\$(\w+)|\{\{\s*(\w+)\s*\}\}")


def is_identifier(name: str) -> bool:
    """Return whether a name is one that a spec may declare."""
    return _IDENTIFIER.fullmatch(name) is not None and len(name) <= MAX_NAME and not _is_reserved(name)


def check_name(node: ScalarNode, what: Subject | str, subject: Subject, findings: Findings, *steps: str) -> bool:
    """Report a name that nothing may have; return whether it is a good one.

    `what` bears the name, or is what in `subject` does so, and `steps` leads from `subject` to it.
    """
    name = node.text
    if node.reported or is_identifier(name):
        return not node.reported
    bearer = f"{what} of {subject}" if isinstance(what, str) else str(what)
    place, path = subject.origin.of(node), subject.part(*steps)
    if _is_reserved(name):
        message = f"{bearer} has a reserved name"
        findings.add("reserved-name", message, place, help=f"{_reserved_for(name)}; choose another", path=path)
        return False
    message = f"{bearer} has no proper name" if name else "a name is empty"
    way_out = _way_out(node.written)
    if way_out.startswith("write") and node is subject.key and subject.section == "context":
        way_out += "; what people read is its 'label'"
    findings.add("ill-formed-name", message, place, help=way_out, path=path)
    return False


def _is_reserved(name: str) -> bool:
    return name in _RESERVED


def _reserved_for(name: str) -> str:
    if name in FUNCTIONS:
        return f"{shown(name)} is a function of the condition language"
    return f"{shown(name)} is a literal" if name in _LITERALS else f"{shown(name)} is a keyword of Python"


def _way_out(name: str) -> str:
    if len(name) > MAX_NAME and "$(" not in name:
        return f"a name has at most {MAX_NAME} letters"
    other = _OTHER_PARAMETER.search(name)
    if other:
        return f"parameters are written $({next(filter(None, other.groups()))}), and only inside a template"
    better = re.sub(r"[^A-Za-z0-9_$()]+", "_", name).strip("_")
    if name.isascii() and better != name and is_identifier(re.sub(r"\$\((\w+)\)", r"\1", better)):
        return f"write {shown(better)}"
    return "names hold only letters A to Z, digits and '_', and begin with a letter"
