"""The category and wording of a change, for each field of the model.

Only fields with a category or wording of their own are listed. All other fields are compared by default, see `walk`.
`elsewhere` marks a field that the comparer of another field takes into account, or that makes no difference.
"""

from __future__ import annotations

from collections.abc import Mapping

from codra_dsl.language import model
from codra_dsl.tooling.diff import algorithms, knowledge
from codra_dsl.tooling.diff.changes import Category
from codra_dsl.tooling.diff.comparers import (
    elsewhere,
    grows,
    guard,
    hidden,
    inline,
    names,
    ordered,
    requesters,
    value_type,
    writers,
    writers_of_variable,
)
from codra_dsl.tooling.diff.observers import observers, resources
from codra_dsl.tooling.diff.variables import variables
from codra_dsl.tooling.diff.walk import Comparer, Table, differs, elements, entries, unordered

KINDS: Mapping[str, str] = {
    **{section: section for section in ("context", "perception", "adaptation")},
    **{
        f"{kind}s": kind
        for kind in (
            *("skill", "observer", "resource", "agent", "type", "node", "edge", "task"),
            *("metric", "action", "tree", "loop"),
        )
    },
}
"""The kinds of elements in identifiers, by section of a spec."""

_NOUNS = {"type": "type of nodes", "edge": "type of edges"}
_AS_ONE = differs(show=hidden)
_DEADLINE = grows(Category.SLOWER, Category.STRONGER)
_INTERVAL = grows(Category.SLOWER, Category.FASTER)
_EXECUTOR = differs(Category.UNWRITABLE, "another agent executes it")
_REFRESH = "'refresh' has changed"


def _ends(key: str) -> Comparer:
    return names((Category.NARROWED, f"leads {key} fewer"), (Category.WIDENED, f"leads {key} more"))


def _has_poses(edge: model.EdgeType) -> bool:
    return edge.motion is not None


FIELDS: Table = {
    object: {  # fields of any class
        "label": differs(Category.WORDING, "has another label", show=repr),
        "description": differs(Category.WORDING, "has another description", show=hidden),
        "valid_for_s": grows(Category.WEAKER, Category.STRONGER),
        "history": grows(Category.EASED, Category.STRONGER),
    },
    model.Spec: {
        **{section: elements(kind, _NOUNS.get(kind, kind)) for section, kind in KINDS.items()},
        "context": variables,
        "perception": algorithms.algorithms,
        "observers": observers,
        "resources": resources,
        "agents": knowledge.agents,
        # Specs are compared with their parts included and their templates expanded.
        **dict.fromkeys(("file", "files", "modules", "uses", "templates"), elsewhere),
    },
    model.Variable: {
        "type": value_type(),
        "sources": writers_of_variable,
        "states_validity": elsewhere,
        "when_unobservable": ordered(
            (Category.WEAKER, "the last value is kept when it can no longer be observed"),
            (Category.STRONGER, "the last value is forgotten when it can no longer be observed"),
            rank=lambda value: value is model.WhenUnobservable.KEEP,
        ),
        "refresh": ordered(
            (Category.SLOWER, _REFRESH), (Category.FASTER, _REFRESH), rank=lambda value: value is model.Refresh.ON_EVENT
        ),
        "node": differs(
            lambda scope: Category.API if knowledge.has_knowledge(scope) else Category.LAYOUT, "belongs to another node"
        ),
        "terms": knowledge.terms,
        "rate": differs(),
        "is_derived": elsewhere,
        "pose_condition": elsewhere,
    },
    model.ValueType: dict.fromkeys(("kind", "unit", "range", "values"), elsewhere),
    model.Algorithm: {
        "name": differs(Category.RENAMED, "has another name"),
        "call": differs(Category.PERCEIVED_OTHERWISE, "another function is called"),
        "parameters": algorithms.literals,
        "uses": algorithms.usages,
        "given": algorithms.given,
        "returns": entries("result", algorithms.result),
        "observable_when": algorithms.observability,
        "accept_when": guard(algorithms.returned_types),
        "identifies": entries(""),
        "timeout_s": _DEADLINE,
        "min_interval_s": _INTERVAL,
        "isolate": differs(Category.PERCEIVED_OTHERWISE),
        "rank": elsewhere,
    },
    model.Usage: {"access": elsewhere},
    model.Returned: {
        "type": value_type(Category.CONTRACT, Category.CONTRACT, Category.EASED),
        "optional": algorithms.optional,
    },
    model.Identification: {"by": algorithms.identified},
    model.Hysteresis: dict.fromkeys(("enter", "leave", "confirm"), elsewhere),
    model.Members: {"cases": elsewhere},
    model.Skill: {
        "preview": names((Category.UNDECLARED, "no longer previews {}"), (Category.ADDED, "previews {} as well")),
        "monitor": knowledge.monitored,
        "changes": names(
            (Category.WEAKER, "acting no longer makes {} unknown"), (Category.STRONGER, "acting makes {} unknown")
        ),
    },
    model.Expectation: dict.fromkeys(("condition", "within_s"), elsewhere),
    model.ObserverSetting: dict.fromkeys(("identifies", "period_s", "priority"), elsewhere),
    model.Resource: {"slots": elsewhere},
    model.NodeType: {"sources": writers, "attributes": entries("attribute"), "view": _AS_ONE},
    model.Attribute: {"type": value_type(), "sources": writers},
    model.NodeElement: {
        "type": differs(Category.RETYPED, "has another type"),
        "values": unordered("the starting values have changed"),
    },
    model.EdgeType: {
        "label": differs(
            lambda scope: Category.API if len({*map(_has_poses, scope.values)}) == 1 else Category.RETYPED,
            "has another label",
        ),
        "origins": _ends("from"),
        "targets": _ends("to"),
        "sources": writers,
        "attributes": entries("attribute"),
        "motion": knowledge.motion,
        "pose": elsewhere,
    },
    model.Task: {
        "origin": differs(Category.RETYPED, "another node does it"),
        "by": _EXECUTOR,
        "requesters": requesters,
        "results": names((Category.NARROWED, "has lost results"), (Category.WIDENED, "has new results")),
        "acknowledge_s": _DEADLINE,
        "finish_s": _DEADLINE,
    },
    model.Agent: {"conduct": inline},
    model.Conduct: {
        "wakes": knowledge.wakes,
        "owns": elsewhere,
        "reads": elsewhere,
        "rules": entries("rule"),
    },
    model.AgentRule: {
        **dict.fromkeys(("before", "during", "after"), guard(knowledge.rule_types)),
        "is_whole": elsewhere,
    },
    model.Output: {
        "rules": unordered("the rules have changed"),
        "terms": knowledge.TERMS,
        "method": _AS_ONE,
    },
    model.Course: {"always": differs()},
    model.Adaptation: {"does": knowledge.action},
    model.TreeElement: {
        "file": knowledge.tree_file,
        "agent": _EXECUTOR,
        "leaves": unordered("the leaves hand over other tasks"),
    },
    model.Loop: {"period_s": _INTERVAL},
}
"""The comparers by class and field."""
