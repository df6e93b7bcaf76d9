"""Collect the imports of a generated module: the names that the module uses, in ruff's order."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from codra_dsl.generation.build_plan.names import CONDITION_WORDS, POSE_FUNCTIONS
from codra_dsl.generation.emit.layout import WIDTH, Expression, lay_out, spread_tuple
from codra_dsl.language.project import GENERATED_API

_NAMES_BY_MODULE: Mapping[str, Iterable[str]] = {
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
        *[*CONDITION_WORDS, "Term"],
        *["Algorithm", "ContextModel", "ExpectationModel", "HandleModel", "ObserverModel", "PreviewCondition"],
        *["ResourceModel", "SkillModel"],
        *["TopicModel", "VariableModel", "boolean", "integer", "member", "real", "text"],
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
        *POSE_FUNCTIONS,
        *["CourseModel", "HardRuleModel", "InputModel", "LoopModel", "Mape", "MapeModel", "OutputModel"],
        *["ParameterModel", "RateKind", "RateModel", "Repeat", "StageModel", "StageRuleModel", "TreeModel"],
        *["Bounds", "End", "Leaves", "terms"],
    ],
}
_MODULE_BY_NAME = {name: module for module, names in _NAMES_BY_MODULE.items() for name in names}
_TEXT = re.compile(r"""(["'])(?:(?!\1)[^\\]|\\.)*\1""")
_WORD = re.compile(r"\w+")
_SECTIONS = (("collections.abc", "contextlib", "typing"), ("py_trees",), ("codra_dsl",))


class Imports:
    """Collects the imported names of a module while it is written."""

    def __init__(self) -> None:
        self._names: set[str] = set()
        self._needs_math = False

    def use(self, *names: str) -> None:
        """Record that the module uses names of the runtime, of py_trees or of Python's library."""
        self._names.update(names)

    def use_in(self, code: Iterable[str], names: Iterable[str]) -> None:
        """Record which of the given names the module uses: those that occur in its code outside of literals."""
        self._names.update(set(names).intersection(_WORD.findall(_TEXT.sub("", "\n".join(code)))))

    def use_math_for(self, values: Iterable[Expression]) -> None:
        """Record that the module contains some values; if one of them is infinite, the module imports `math`."""
        self._needs_math = self._needs_math or any(value in ("math.inf", "-math.inf") for value in values)

    def lines(self) -> str:
        """Return the import statements: of Python, then of py_trees, then of codra, separated by blank lines."""
        names_by_module: dict[str, list[str]] = {}
        for name in self._names:
            names_by_module.setdefault(_MODULE_BY_NAME[name], []).append(name)
        statements = [(module, import_statement(module, names_by_module[module])) for module in sorted(names_by_module)]
        math_import = ["import math"] if self._needs_math else []
        sections = [
            [
                *(math_import if number == 0 else []),
                *(text for module_name, text in statements if module_name.startswith(modules)),
            ]
            for number, modules in enumerate(_SECTIONS)
        ]
        return "\n\n".join("\n".join(section) for section in sections if section)


def import_statement(module: str, names: Iterable[str]) -> str:
    """Return the statement that imports names from a module."""
    before = f"from {module} import "
    flat = ", ".join(sorted(names, key=_sort_key))
    if len(before) + len(flat) <= WIDTH:
        return before + flat
    return before + lay_out(spread_tuple(flat.split(", ")))


def _sort_key(name: str) -> tuple[int, list[str | int]]:
    """Return ruff's sort key: constants, then classes, then other names. Numbers in names are sorted by value."""
    parts = [int(part) if part.isdecimal() else part for part in re.split("([0-9]+)", name)]
    return (0 if name.isupper() else 1 if name[0].isupper() else 2, parts)
