"""The built-in nodes with their ports, and the refused nodes of BehaviorTree.CPP with the help for each of them."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum

from codra_dsl.language.behavior_trees.values import NodeKind
from codra_dsl.language.frozen import dataclass


class PortContent(StrEnum):
    """The content that the port of a built-in node may have."""

    TEXT = "a text"
    INTEGER = "a whole number"
    MILLISECONDS = "a whole number of milliseconds, at least 0"
    TRUTH = "true or false"
    RESULT = "SUCCESS, FAILURE, SKIPPED or RUNNING"
    ENTRY = "the name of an entry"
    KEY = "the name of an entry, without braces"
    OUTPUT = "an entry, {name}"
    CONDITION = "a condition"
    SCRIPT = "a script"


@dataclass(frozen=True, slots=True)
class BuiltInPort:
    """A port of a built-in node.

    Attributes:
        default: the value of the port if a node does not give one; None if the node must give one.
    """

    name: str
    content: PortContent
    default: str | None = None


@dataclass(frozen=True, slots=True)
class BuiltIn:
    """A built-in node.

    Attributes:
        min_children: the minimum number of children.
        max_children: the maximum number of children; None for any.
        word: the name of the node's class or function in `codra_dsl.runtime.behavior_trees`.
    """

    kind: NodeKind
    word: str
    min_children: int = 0
    max_children: int | None = 0
    ports: tuple[BuiltInPort, ...] = ()


def _control(word: str, *ports: BuiltInPort, min_children: int = 1, max_children: int | None = None) -> BuiltIn:
    return BuiltIn(NodeKind.CONTROL, word, min_children, max_children, ports)


def _decorator(word: str, *ports: BuiltInPort) -> BuiltIn:
    return BuiltIn(NodeKind.DECORATOR, word, 1, 1, ports)


def _leaf(word: str, *ports: BuiltInPort, kind: NodeKind = NodeKind.ACTION) -> BuiltIn:
    return BuiltIn(kind, word, 0, 0, ports)


def _switch(cases: int) -> BuiltIn:
    names = ("variable", *(f"case_{number}" for number in range(1, cases + 1)))
    return _control(
        "Switch",
        *(BuiltInPort(name, PortContent.TEXT) for name in names),
        min_children=cases + 1,
        max_children=cases + 1,
    )


def _loop(word: str) -> BuiltIn:
    ports = (
        ("queue", PortContent.TEXT, None),
        ("value", PortContent.OUTPUT, ""),
        ("if_empty", PortContent.RESULT, "SUCCESS"),
    )
    return _decorator(word, *(BuiltInPort(*port) for port in ports))


_ENTRY_PORT = BuiltInPort("entry", PortContent.ENTRY)
_CODE_PORT = BuiltInPort("code", PortContent.SCRIPT)

BUILT_IN: Mapping[str, BuiltIn] = {
    "Sequence": _control("sequence"),
    "AsyncSequence": _control("async_sequence"),
    "SequenceWithMemory": _control("sequence_with_memory"),
    "ReactiveSequence": _control("reactive_sequence"),
    "Fallback": _control("fallback"),
    "AsyncFallback": _control("async_fallback"),
    "ReactiveFallback": _control("reactive_fallback"),
    "Parallel": _control(
        "Parallel",
        BuiltInPort("success_count", PortContent.INTEGER, "-1"),
        BuiltInPort("failure_count", PortContent.INTEGER, "1"),
    ),
    "ParallelAll": _control("ParallelAll", BuiltInPort("max_failures", PortContent.INTEGER, "1")),
    "IfThenElse": _control("IfThenElse", min_children=2, max_children=3),
    "WhileDoElse": _control("WhileDoElse", min_children=2, max_children=3),
    **{f"Switch{cases}": _switch(cases) for cases in range(2, 7)},
    "Inverter": _decorator("inverter"),
    "ForceSuccess": _decorator("force_success"),
    "ForceFailure": _decorator("force_failure"),
    "KeepRunningUntilFailure": _decorator("keep_running_until_failure"),
    "Repeat": _decorator("repeat", BuiltInPort("num_cycles", PortContent.INTEGER)),
    "RetryUntilSuccessful": _decorator("retry_until_successful", BuiltInPort("num_attempts", PortContent.INTEGER)),
    "Delay": _decorator("Delay", BuiltInPort("delay_msec", PortContent.MILLISECONDS)),
    "Timeout": _decorator("Timeout", BuiltInPort("msec", PortContent.MILLISECONDS)),
    "RunOnce": _decorator("RunOnce", BuiltInPort("then_skip", PortContent.TRUTH, "true")),
    "Precondition": _decorator(
        "Precondition", BuiltInPort("if", PortContent.CONDITION), BuiltInPort("else", PortContent.RESULT, "FAILURE")
    ),
    "SkipUnlessUpdated": _decorator("skip_unless_updated", _ENTRY_PORT),
    "WaitValueUpdate": _decorator("wait_value_update", _ENTRY_PORT),
    "LoopInt": _loop("loop_int"),
    "LoopDouble": _loop("loop_double"),
    "LoopString": _loop("loop_string"),
    "LoopBool": _loop("loop_bool"),
    "SubTree": BuiltIn(NodeKind.SUBTREE, "Subtree"),
    "AlwaysSuccess": _leaf("always_success"),
    "AlwaysFailure": _leaf("always_failure"),
    "Sleep": _leaf("Sleep", BuiltInPort("msec", PortContent.MILLISECONDS)),
    "Script": _leaf("script", _CODE_PORT),
    "ScriptCondition": _leaf("script_condition", BuiltInPort("code", PortContent.CONDITION), kind=NodeKind.CONDITION),
    "SetBlackboard": _leaf(
        "set_blackboard", BuiltInPort("value", PortContent.TEXT), BuiltInPort("output_key", PortContent.KEY)
    ),
    "UnsetBlackboard": _leaf("unset_blackboard", BuiltInPort("key", PortContent.KEY)),
    "WasEntryUpdated": _leaf("WasEntryUpdated", _ENTRY_PORT),
}

REFUSED_NODES: Mapping[str, str] = {
    "ManualSelector": "it asks a person at a terminal: use Switch2 to Switch6 with an entry that a page writes",
    "TestNode": "it replaces nodes in tests: in a test, give the robot another action of the same name",
    "LoopNode": "write LoopInt, LoopDouble, LoopString or LoopBool",
    "ConsumeQueue": "write LoopInt, LoopDouble, LoopString or LoopBool",
    "PopFromQueue": "write LoopInt, LoopDouble, LoopString or LoopBool",
    "QueueSize": "keep the number of items in an entry of its own",
    "EntryUpdated": "write WasEntryUpdated, SkipUnlessUpdated or WaitValueUpdate",
    "TryCatch": "write Fallback, and the script to run on halt as _onHalted",
    "AlwaysRunning": "write Sleep with a long time",
    "SequenceStar": "write SequenceWithMemory",
    "FallbackStar": "write Fallback",
    "RetryUntilSuccesful": "write RetryUntilSuccessful",
    "SubTreePlus": "write SubTree",
    **{f"BlackboardCheck{type_}": "write Precondition with a script" for type_ in ("Int", "Double", "String", "Bool")},
}

PRECONDITIONS = {"_failureIf": "failure_if", "_successIf": "success_if", "_skipIf": "skip_if", "_while": "while_true"}
"""The attributes with conditions that are evaluated before a tick, in this order, and their names in Python."""

POST_SCRIPTS = {"_onSuccess": "on_success", "_onFailure": "on_failure", "_post": "post", "_onHalted": "on_halted"}
"""The attributes with scripts that run after a tick, and their names in Python."""

AUTOREMAP = "_autoremap"

EDITOR_ATTRIBUTES = frozenset({"_uid", "_fullpath", "_description", "_collapsed", "_favorite"})
"""Attributes that editors write, and that have no effect."""
