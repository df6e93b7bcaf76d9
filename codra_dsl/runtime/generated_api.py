"""The only module of CoDRA DSL that generated code imports. It exports exactly the names that the compiler can write.

Programs written by hand import `codra_dsl.runtime` and its packages. Names of loops, fuzzy engines and behavior trees
are imported when they are first used. So a package without loops loads neither these modules nor numpy.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.context.agents import Agent
from codra_dsl.runtime.context.context import ContextManager
from codra_dsl.runtime.context.model import ContextModel
from codra_dsl.runtime.geometry import Motion, Pose
from codra_dsl.runtime.journal import EventLog
from codra_dsl.runtime.knowledge import (
    AgentHandle,
    Edge,
    Handover,
    Knowledge,
    Node,
    Request,
    RuleExecution,
    Snapshot,
    Transaction,
)
from codra_dsl.runtime.knowledge.declarations import (
    AgentModel,
    AttributeModel,
    EdgeModel,
    EdgeTypeModel,
    KnowledgeModel,
    NodeModel,
    NodeTypeModel,
    Phase,
    RuleModel,
    TaskModel,
    ViewModel,
    Writer,
    absent,
    anything,
    backward,
    by,
    distance,
    in_view,
    path,
    ranked,
    some,
)
from codra_dsl.runtime.observers.behaviours import Accept, ControlFlag, DueOrRunning, Identify, Perceive, Precondition
from codra_dsl.runtime.observers.observer import Observer, ObserverModel
from codra_dsl.runtime.values.cell import Reading
from codra_dsl.runtime.values.conditions import (
    Term,
    age,
    between,
    choose,
    confirmed,
    first_known,
    first_of,
    known,
    literal,
    maximum,
    minimum,
    value,
)
from codra_dsl.runtime.values.model import (
    Algorithm,
    ExpectationModel,
    HandleModel,
    PreviewCondition,
    ResourceModel,
    SkillModel,
    TopicModel,
    VariableModel,
    boolean,
    integer,
    member,
    real,
    text,
)

if TYPE_CHECKING:
    from codra_dsl.runtime.behavior_trees import (
        Conditions,
        Control,
        Delay,
        Entry,
        IfThenElse,
        Leaf,
        Parallel,
        ParallelAll,
        RunOnce,
        Scope,
        Sleep,
        Subtree,
        Switch,
        Timeout,
        WasEntryUpdated,
        WhileDoElse,
        always_failure,
        always_success,
        assign,
        async_fallback,
        async_sequence,
        create,
        fallback,
        force_failure,
        force_success,
        inverter,
        keep_running_until_failure,
        loop_bool,
        loop_double,
        loop_int,
        loop_string,
        reactive_fallback,
        reactive_sequence,
        repeat,
        retry_until_successful,
        script,
        script_condition,
        sequence,
        sequence_with_memory,
        set_blackboard,
        skip_unless_updated,
        unset_blackboard,
        wait_value_update,
    )
    from codra_dsl.runtime.behavior_trees import Node as TreeNode
    from codra_dsl.runtime.behavior_trees import Precondition as TreePrecondition
    from codra_dsl.runtime.behavior_trees.node import Leaves
    from codra_dsl.runtime.loops.declarations import (
        CourseModel,
        HardRuleModel,
        InputModel,
        LoopModel,
        MapeModel,
        OutputModel,
        ParameterModel,
        RateKind,
        RateModel,
        Repeat,
        StageModel,
        StageRuleModel,
        TreeModel,
    )
    from codra_dsl.runtime.loops.fuzzy import (
        activations,
        bounded_activations,
        bounded_formulas,
        bounded_outputs,
        bounds,
        defuzzifiers,
        formulas,
        hedges,
        norms,
        outputs,
        terms,
    )
    from codra_dsl.runtime.loops.fuzzy.bounds import BoundedInference, Bounds, End
    from codra_dsl.runtime.loops.fuzzy.outputs import Inference
    from codra_dsl.runtime.loops.loop import Mape

__all__ = [
    "Accept",
    "Agent",
    "AgentHandle",
    "AgentModel",
    "Algorithm",
    "AttributeModel",
    "BoundedInference",
    "Bounds",
    "Clock",
    "Conditions",
    "ContextManager",
    "ContextModel",
    "Control",
    "ControlFlag",
    "CourseModel",
    "Delay",
    "DueOrRunning",
    "Edge",
    "EdgeModel",
    "EdgeTypeModel",
    "End",
    "Entry",
    "EventLog",
    "ExpectationModel",
    "HandleModel",
    "Handover",
    "HardRuleModel",
    "Identify",
    "IfThenElse",
    "Inference",
    "InputModel",
    "Knowledge",
    "KnowledgeModel",
    "Leaf",
    "Leaves",
    "LoopModel",
    "Mape",
    "MapeModel",
    "Motion",
    "Node",
    "NodeModel",
    "NodeTypeModel",
    "Observer",
    "ObserverModel",
    "OutputModel",
    "Parallel",
    "ParallelAll",
    "ParameterModel",
    "Perceive",
    "Phase",
    "Pose",
    "Precondition",
    "PreviewCondition",
    "RateKind",
    "RateModel",
    "Reading",
    "Repeat",
    "Request",
    "ResourceModel",
    "RuleExecution",
    "RuleModel",
    "RunOnce",
    "Scope",
    "SkillModel",
    "Sleep",
    "Snapshot",
    "StageModel",
    "StageRuleModel",
    "Subtree",
    "Switch",
    "TaskModel",
    "Term",
    "Timeout",
    "TopicModel",
    "Transaction",
    "TreeModel",
    "TreeNode",
    "TreePrecondition",
    "VariableModel",
    "ViewModel",
    "WasEntryUpdated",
    "WhileDoElse",
    "Writer",
    "absent",
    "activations",
    "age",
    "always_failure",
    "always_success",
    "anything",
    "assign",
    "async_fallback",
    "async_sequence",
    "backward",
    "between",
    "boolean",
    "bounded_activations",
    "bounded_formulas",
    "bounded_outputs",
    "bounds",
    "by",
    "choose",
    "confirmed",
    "create",
    "defuzzifiers",
    "distance",
    "fallback",
    "first_known",
    "first_of",
    "force_failure",
    "force_success",
    "formulas",
    "hedges",
    "in_view",
    "integer",
    "inverter",
    "keep_running_until_failure",
    "known",
    "literal",
    "loop_bool",
    "loop_double",
    "loop_int",
    "loop_string",
    "maximum",
    "member",
    "minimum",
    "norms",
    "outputs",
    "path",
    "ranked",
    "reactive_fallback",
    "reactive_sequence",
    "real",
    "repeat",
    "retry_until_successful",
    "script",
    "script_condition",
    "sequence",
    "sequence_with_memory",
    "set_blackboard",
    "skip_unless_updated",
    "some",
    "terms",
    "text",
    "unset_blackboard",
    "value",
    "wait_value_update",
]

_TREES_PACKAGE = "codra_dsl.runtime.behavior_trees"
_FUZZY_PACKAGE = "codra_dsl.runtime.loops.fuzzy"
_FUZZY_MODULE_NAMES = frozenset(
    {
        *("activations", "bounded_activations", "bounded_formulas", "bounded_outputs", "bounds", "defuzzifiers"),
        *("formulas", "hedges", "norms", "outputs", "terms"),
    }
)
_LAZY_IMPORTS = {
    "codra_dsl.runtime.loops.declarations": (
        *("CourseModel", "HardRuleModel", "InputModel", "LoopModel", "MapeModel", "OutputModel", "ParameterModel"),
        *("RateKind", "RateModel", "Repeat", "StageModel", "StageRuleModel", "TreeModel"),
    ),
    "codra_dsl.runtime.loops.fuzzy.bounds": ("BoundedInference", "Bounds", "End"),
    "codra_dsl.runtime.loops.fuzzy.outputs": ("Inference",),
    "codra_dsl.runtime.loops.loop": ("Mape",),
    "codra_dsl.runtime.behavior_trees.node": ("Leaves",),
}
_MODULES_OF_LAZY_NAMES = {name: module for module, names in _LAZY_IMPORTS.items() for name in names}
"""The module of each name that is imported on first use, except names of `_FUZZY_MODULE_NAMES` and `_TREES_PACKAGE`."""

_ORIGINAL_NAMES = {"TreeNode": "Node", "TreePrecondition": "Precondition"}
"""For classes of `_TREES_PACKAGE` that have another name here: a mapping from this name to the original name."""


def _import_lazily(name: str) -> object:
    """Import an object of loops, fuzzy engines or behavior trees when its name is used for the first time."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if name in _FUZZY_MODULE_NAMES:
        imported_object: object = import_module(f"{_FUZZY_PACKAGE}.{name}")
    else:
        module = import_module(_MODULES_OF_LAZY_NAMES.get(name, _TREES_PACKAGE))
        imported_object = getattr(module, _ORIGINAL_NAMES.get(name, name))
    globals()[name] = imported_object
    return imported_object


if not TYPE_CHECKING:  # type checkers see only the imports above, so they report names that do not exist
    __getattr__ = _import_lazily
