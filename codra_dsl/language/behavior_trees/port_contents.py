"""Which texts and types the ports of nodes accept."""

from __future__ import annotations

from codra_dsl.language.behavior_trees.catalogue import PortContent
from codra_dsl.language.behavior_trees.ports import is_key

RESULTS = ("SUCCESS", "FAILURE", "SKIPPED", "RUNNING")
_NUMBER_TYPES = frozenset(
    {"int", "unsigned", "double", "float", "bool", "int64_t", "uint64_t", "unsigned int", "std::size_t"}
)
_INTEGER_TYPES = frozenset({"int", "unsigned", "int64_t", "uint64_t", "unsigned int", "std::size_t"})
_ANY_VALUE_TYPES = frozenset({"", "BT::Any", "BT::AnyTypeAllowed", "AnyTypeAllowed", "std::string", "string"})


def accepts_any_value(type_: str | None) -> bool:
    """Return whether a port accepts any value. A port for a text does, because a text can be read as any type."""
    return type_ is None or type_ in _ANY_VALUE_TYPES


def type_family(type_: str) -> str:
    """Return the type, or "number" for all types of numbers, which can be converted into each other."""
    return "number" if type_ in _NUMBER_TYPES else type_


def is_value_of(type_: str | None, text: str) -> bool:
    """Return whether a text is a value of a C++ type; true for types that are not known here."""
    if type_ == "bool":
        return is_valid_content(PortContent.TRUTH, text)
    if type_ in _INTEGER_TYPES:
        return is_valid_content(PortContent.INTEGER, text) and not (
            str(type_).startswith("u") and text.strip().startswith("-")
        )
    if type_ in ("double", "float"):
        try:
            float(text)
        except ValueError:
            return False
    return True


def is_valid_content(content: PortContent, text: str) -> bool:
    """Return whether a text is valid for a built-in port."""
    match content:
        case PortContent.INTEGER | PortContent.MILLISECONDS:
            digits = text.removeprefix("-") if content is PortContent.INTEGER else text
            return digits.isascii() and digits.isdigit() and len(digits) < 10
        case PortContent.TRUTH:
            return text in ("true", "false", "1", "0")
        case PortContent.RESULT:
            return text in RESULTS
        case PortContent.ENTRY | PortContent.KEY:
            return is_key(text)
        case PortContent.OUTPUT:
            return False
    return True
