"""The imports of a generated module: the names that it uses, sorted as ruff sorts them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from codra_dsl.generation.emit.conditions import POSES, WORDS
from codra_dsl.generation.emit.layout import WIDTH, Expression, laid_out, spread_tuple
from codra_dsl.language.project import GENERATED_API

_HOMES: Mapping[str, Iterable[str]] = {
    "collections.abc": ["Callable", "Mapping"],
    "contextlib": ["AbstractContextManager"],
    "typing": ["TYPE_CHECKING", "Any", "Literal", "Never", "TypeVar", "overload"],
    "py_trees.behaviour": ["Behaviour"],
    "py_trees.common": ["ParallelPolicy"],
    "py_trees.composites": ["Parallel", "Selector", "Sequence"],
    "py_trees.decorators": ["FailureIsSuccess"],
    GENERATED_API: [
        *["Agent", "Clock", "ContextManager", "Reading", "EventLog"],
        *["Accept", "ControlFlag", "DueOrRunning", "Identify", "Observer", "Perceive", "Precondition"],
        *[*WORDS, "Term"],
        *["Algorithm", "ContextModel", "ExpectationModel", "ObserverModel", "ResourceModel", "SkillModel"],
        *["VariableModel", "boolean", "integer", "member", "real", "text"],
        *["Motion", "Pose"],
        *[
            "RuleExecution",
            "AgentHandle",
            "Edge",
            "Handover",
            "Knowledge",
            "Node",
            "Request",
            "Snapshot",
            "Transaction",
        ],
        *["AgentModel", "AttributeModel", "EdgeModel", "EdgeTypeModel", "KnowledgeModel", "NodeModel", "NodeTypeModel"],
        *["Phase", "RuleModel", "TaskModel", "ViewModel", "Writer"],
        *["absent", "anything", "backward", "by", "path", "ranked", "some"],
        *POSES,
        *["CourseModel", "HardRuleModel", "InputModel", "LoopModel", "Mape", "MapeModel", "OutputModel"],
        *["ParameterModel", "RateModel", "Repeat", "StageModel", "StageRuleModel", "TreeModel"],
        *["Bounds", "End", "Leaves", "terms"],
    ],
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}
_TEXT = re.compile(r"""(["'])(?:(?!\1)[^\\]|\\.)*\1""")
_WORD = re.compile(r"\w+")
_SECTIONS = (("collections.abc", "contextlib", "typing"), ("py_trees",), ("codra_dsl",))


class Imports:
    """Collects names while a module is written."""

    def __init__(self) -> None:
        self._names: set[str] = set()
        self._math = False

    def use(self, *names: str) -> None:
        """Record that the module uses names of the runtime, of py_trees or of Python's library."""
        self._names.update(names)

    def use_in(self, code: Iterable[str], names: Iterable[str]) -> None:
        """Record that the module uses those of some names that occur in its code, outside of literals."""
        self._names.update(set(names).intersection(_WORD.findall(_TEXT.sub("", "\n".join(code)))))

    def use_math_for(self, values: Iterable[Expression]) -> None:
        """Record that the module contains some values, which may be infinite."""
        self._math = self._math or any(value in ("math.inf", "-math.inf") for value in values)

    def lines(self) -> str:
        """Return the import statements: Python's own, then py_trees', then ours, separated by blank lines."""
        by_home: dict[str, list[str]] = {}
        for name in self._names:
            by_home.setdefault(_HOME[name], []).append(name)
        statements = [(home, statement(home, by_home[home])) for home in sorted(by_home)]
        plain = ["import math"] if self._math else []
        sections = [
            [*(plain if number == 0 else []), *(text for home, text in statements if home.startswith(homes))]
            for number, homes in enumerate(_SECTIONS)
        ]
        return "\n\n".join("\n".join(section) for section in sections if section)


def statement(home: str, names: Iterable[str]) -> str:
    """Return the statement that imports names from a module."""
    before = f"from {home} import "
    flat = ", ".join(sorted(names, key=_by_kind))
    if len(before) + len(flat) <= WIDTH:
        return before + flat
    return before + laid_out(spread_tuple(flat.split(", ")))


def _by_kind(name: str) -> tuple[int, list[str | int]]:
    """Return ruff's sort key: constants, classes, the rest; numbers within names by their value."""
    parts = [int(part) if part.isdecimal() else part for part in re.split("([0-9]+)", name)]
    return (0 if name.isupper() else 1 if name[0].isupper() else 2, parts)
