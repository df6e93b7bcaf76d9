"""The names that a spec may declare."""

from __future__ import annotations

import keyword
import re

from codra_dsl.language.expression import FUNCTIONS, MAX_NAME, is_identifier
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.language.load.yaml.nodes import ScalarNode
from codra_dsl.language.load.yaml.origin import Subject

_LITERALS = frozenset({"true", "false", "null"})
_RESERVED = frozenset({*keyword.kwlist, *FUNCTIONS, *_LITERALS})
_FOREIGN_PARAMETER = re.compile(r"\$\{(\w+)\}|\$(\w+)|\{\{\s*(\w+)\s*\}\}")


def check_name(node: ScalarNode, owner: Subject | str, subject: Subject, findings: Findings, *steps: str) -> bool:
    """Report an invalid name; return whether it is valid.

    `owner` is the element with the name, or the noun for a part of `subject`. `steps` lead from `subject` to the part.
    """
    name = node.text
    if node.reported or is_identifier(name):
        return not node.reported
    owner_text = f"{owner} of {subject}" if isinstance(owner, str) else str(owner)
    place, path = subject.origin.of(node), subject.part(*steps)
    if name in _RESERVED:
        message = f"{owner_text} has a reserved name"
        findings.add("reserved-name", message, place, help=f"{_reservation_reason(name)}; choose another", path=path)
        return False
    message = f"{owner_text} has an invalid name" if name else "a name is empty"
    help_text = _name_help(node.written)
    if help_text.startswith("write") and node is subject.key and subject.section == "context":
        help_text += "; write the name for people under 'label'"
    findings.add("ill-formed-name", message, place, help=help_text, path=path)
    return False


def _reservation_reason(name: str) -> str:
    if name in FUNCTIONS:
        return f"{shown(name)} is a function of the condition language"
    return f"{shown(name)} is a literal" if name in _LITERALS else f"{shown(name)} is a Python keyword"


def _name_help(name: str) -> str:
    if len(name) > MAX_NAME and "$(" not in name:
        return f"a name has at most {MAX_NAME} letters"
    foreign_match = _FOREIGN_PARAMETER.search(name)
    if foreign_match:
        return f"parameters are written $({next(filter(None, foreign_match.groups()))}), and only inside a template"
    corrected_name = re.sub(r"[^A-Za-z0-9_$()]+", "_", name).strip("_")
    if name.isascii() and corrected_name != name and is_identifier(re.sub(r"\$\((\w+)\)", r"\1", corrected_name)):
        return f"write {shown(corrected_name)}"
    return "names hold only letters A to Z, digits and '_', and begin with a letter"
