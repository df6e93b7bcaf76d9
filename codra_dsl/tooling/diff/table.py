"""The category and wording of a change, for each field of the model.

Only fields with a category or wording of their own are listed. All other fields are compared by default, see `walk`.
`compare_nothing` marks a field that the comparer of another field takes into account, or that makes no difference.
"""

from __future__ import annotations

from collections.abc import Mapping

from codra_dsl.language import model
from codra_dsl.tooling.diff import algorithms, knowledge
from codra_dsl.tooling.diff.changes import Category
from codra_dsl.tooling.diff.comparers import (
    compare_inline,
    compare_nothing,
    compare_rate,
    compare_requesters,
    compare_writers,
    growth_comparer,
    guard_comparer,
    name_comparer,
    order_comparer,
    show_nothing,
    type_comparer,
)
from codra_dsl.tooling.diff.observers import compare_observers, compare_resources
from codra_dsl.tooling.diff.variables import compare_derivation, compare_sources, compare_variables
from codra_dsl.tooling.diff.version import duration_text
from codra_dsl.tooling.diff.walk import (
    Comparer,
    ComparerTable,
    element_comparer,
    entry_comparer,
    equality_comparer,
    set_comparer,
)

KIND_BY_SECTION: Mapping[str, str] = {
    **{section: section for section in ("context", "perception", "adaptation")},
    **{
        f"{kind}s": kind
        for kind in (
            *("skill", "observer", "resource", "agent", "type", "node", "edge", "task"),
            *("metric", "action", "tree", "loop"),
        )
    },
}
"""A mapping from each section of a spec to the kind of its elements, as identifiers write it."""

_NOUN_BY_KIND = {"type": "type of nodes", "edge": "type of edges"}
_HIDDEN_VALUE_COMPARER = equality_comparer(show=show_nothing)
_DEADLINE_COMPARER = growth_comparer(Category.SLOWER, Category.STRONGER)
_INTERVAL_COMPARER = growth_comparer(Category.SLOWER, Category.FASTER)
_EXECUTOR_COMPARER = equality_comparer(Category.UNWRITABLE, "another agent executes it")
_REFRESH_MESSAGE = "'refresh' has changed"


def _ends_comparer(key: str) -> Comparer:
    return name_comparer(
        (Category.NARROWED, f"'{key}' allows fewer ends"), (Category.WIDENED, f"'{key}' allows more ends")
    )


FIELD_COMPARERS: ComparerTable = {
    object: {  # fields of any class
        "label": equality_comparer(Category.WORDING, "has another label", show=repr),
        "description": equality_comparer(Category.WORDING, "has another description", show=show_nothing),
        "valid_for_s": growth_comparer(Category.WEAKER, Category.STRONGER),
        "history": growth_comparer(Category.EASED, Category.STRONGER),
    },
    model.Spec: {
        **{section: element_comparer(kind, _NOUN_BY_KIND.get(kind, kind)) for section, kind in KIND_BY_SECTION.items()},
        "context": compare_variables,
        "perception": algorithms.compare_algorithms,
        "observers": compare_observers,
        "resources": compare_resources,
        "agents": knowledge.compare_agents,
        # Specs are compared with their parts included, their templates expanded, and the values of their sites.
        **dict.fromkeys(("file", "files", "modules", "site", "uses", "templates"), compare_nothing),
    },
    model.Variable: {
        "type": type_comparer(),
        "sources": compare_sources,
        "derived": compare_derivation,
        "resolution_m": equality_comparer(
            show=lambda resolution_m: "none" if resolution_m is None else f"{resolution_m:g} m"
        ),
        "states_validity": compare_nothing,
        "when_unobservable": order_comparer(
            (Category.WEAKER, "the last value is kept when it can no longer be observed"),
            (Category.STRONGER, "the last value is forgotten when it can no longer be observed"),
            rank_of=lambda value: value is model.WhenUnobservable.KEEP,
        ),
        "refresh": order_comparer(
            (Category.SLOWER, _REFRESH_MESSAGE),
            (Category.FASTER, _REFRESH_MESSAGE),
            rank_of=lambda value: value is model.Refresh.ON_EVENT,
        ),
        "node": equality_comparer(
            lambda scope: Category.API if knowledge.has_knowledge(scope) else Category.LAYOUT, "belongs to another node"
        ),
        "terms": knowledge.compare_terms,
        "rate": compare_rate,
        "is_derived": compare_nothing,
        "pose_condition": compare_nothing,
        "ros": equality_comparer(Category.PERCEIVED_OTHERWISE, "its values come from another topic of ROS 2"),
    },
    model.ValueType: dict.fromkeys(("kind", "unit", "range", "values"), compare_nothing),
    model.Algorithm: {
        "name": equality_comparer(Category.RENAMED, "has another name"),
        "call": equality_comparer(Category.PERCEIVED_OTHERWISE, "another function is called"),
        "parameters": algorithms.compare_literals,
        "uses": algorithms.compare_usages,
        "given": algorithms.compare_given_variables,
        "returns": entry_comparer("result", algorithms.result_wording),
        "observable_when": algorithms.compare_observability,
        "accept_when": guard_comparer(algorithms.returned_types),
        "identifies": entry_comparer(""),
        "timeout_s": _DEADLINE_COMPARER,
        "min_interval_s": _INTERVAL_COMPARER,
        "isolate": equality_comparer(Category.PERCEIVED_OTHERWISE),
        "host": equality_comparer(Category.PERCEIVED_OTHERWISE),
        "rank": compare_nothing,
    },
    model.Usage: {"access": compare_nothing},
    model.Returned: {
        "type": type_comparer(Category.CONTRACT, Category.CONTRACT, Category.EASED),
        "optional": algorithms.compare_optionality,
    },
    model.Identification: {"by": algorithms.compare_identification},
    model.Hysteresis: dict.fromkeys(("enter", "leave", "confirm"), compare_nothing),
    model.Members: {"cases": compare_nothing},
    model.Skill: {
        "preview": name_comparer(
            (Category.UNDECLARED, "no longer previews {}"), (Category.ADDED, "previews {} as well")
        ),
        "preview_names": compare_nothing,
        "preview_conditions": algorithms.compare_preview_conditions,
        "monitor": knowledge.compare_monitor,
        "changes": name_comparer(
            (Category.WEAKER, "acting no longer makes {} unknown"), (Category.STRONGER, "acting makes {} unknown")
        ),
    },
    model.Expectation: dict.fromkeys(("condition", "within_s"), compare_nothing),
    model.ObserverSetting: dict.fromkeys(("identifies", "period_s", "priority"), compare_nothing),
    model.Resource: {"slots": compare_nothing},
    model.NodeType: {
        "sources": compare_writers,
        "attributes": entry_comparer("attribute"),
        "view": _HIDDEN_VALUE_COMPARER,
    },
    model.Attribute: {"type": type_comparer(), "sources": compare_writers},
    model.NodeElement: {
        "type": equality_comparer(Category.RETYPED, "has another type"),
        "values": set_comparer("the starting values have changed"),
    },
    model.EdgeType: {
        "label": equality_comparer(
            # The type has changed if the edge has poses in only one version.
            lambda scope: (
                Category.API if len({edge.motion is None for edge in scope.values}) == 1 else Category.RETYPED
            ),
            "has another label",
        ),
        "origins": _ends_comparer("from"),
        "targets": _ends_comparer("to"),
        "sources": compare_writers,
        "attributes": entry_comparer("attribute"),
        "motion": knowledge.compare_motion,
        "pose": compare_nothing,
    },
    model.Task: {
        "origin": equality_comparer(Category.RETYPED, "another node does the task"),
        "by": _EXECUTOR_COMPARER,
        "requesters": compare_requesters,
        "results": name_comparer((Category.NARROWED, "has lost results"), (Category.WIDENED, "has new results")),
        "acknowledge_s": _DEADLINE_COMPARER,
        "finish_s": _DEADLINE_COMPARER,
    },
    model.Agent: {"conduct": compare_inline, "period_s": _INTERVAL_COMPARER},
    model.Conduct: {
        "wakes": knowledge.compare_wakes,
        "owns": compare_nothing,
        "reads": compare_nothing,
        "rules": entry_comparer("rule"),
    },
    model.AgentRule: {
        **dict.fromkeys(("before", "during", "after"), guard_comparer(knowledge.rule_types)),
        "is_whole": compare_nothing,
    },
    model.Output: {
        "rules": set_comparer("the rules have changed"),
        "terms": knowledge.TERMS_COMPARER,
        "method": _HIDDEN_VALUE_COMPARER,
        "hold_s": equality_comparer(show=duration_text),
    },
    model.Course: {"always": equality_comparer(), "node": knowledge.compare_course_node},
    model.Parameter: {"otherwise": equality_comparer()},
    model.Adaptation: {"does": knowledge.compare_effect},
    model.TreeElement: {
        "file": knowledge.compare_tree_file,
        "agent": _EXECUTOR_COMPARER,
        "leaves": set_comparer("the leaves hand over other tasks"),
    },
    model.Loop: {"period_s": _INTERVAL_COMPARER},
}
"""The comparers, by class and then by field."""
