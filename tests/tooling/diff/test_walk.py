"""Every field of the model is compared, and changes of a new field are reported without an edit of the review."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from codra_dsl.compiler import plan_paths, plan_text
from codra_dsl.generation.build_plan import BuildPlan
from codra_dsl.language import model
from codra_dsl.tooling.diff import Category, Version, review
from codra_dsl.tooling.diff.table import FIELD_COMPARERS
from tests.tooling.diff.test_changes import BASE

CASES = Path(__file__).parents[2] / "cases/valid"
MODEL_CLASSES = [
    cls
    for _, cls in sorted(inspect.getmembers(model, inspect.isclass))
    if dataclasses.is_dataclass(cls) and cls is not model.Setting  # describes a field; no spec holds a value of it
]
WHOLE_VALUE_CLASSES = {
    "Condition": "conditions are compared by meaning",
    "DeclaredParameter": "specs are compared with their templates expanded",
    "DeclaredTemplate": "specs are compared with their templates expanded",
    "FuzzyTerm": "the terms of an element are compared together",
    "Handle": "handles are compared with their resources, by their text",
    "HardRule": "the hard rules of a course are compared together",
    "LeafTasks": "the leaves of a tree are compared together",
    "Letters": "only places",
    "Method": "the method of inference is compared as one value",
    "Motion": "the motion of an edge is compared as one value, except for `valid_for`",
    "Phrase": "the rules of a metric are compared together",
    "PoseCondition": "guards are compared with their comparisons of poses",
    "Rate": "a rate is compared as one value",
    "Reference": "references are compared by name",
    "Replacement": "specs are compared with the values of their sites",
    "Site": "specs are compared with the values of their sites",
    "StartingPose": "a pose is compared as one value",
    "StartingValue": "the starting values of a node are compared together",
    "Topic": "a topic is compared as one value",
    "Use": "specs are compared with their templates expanded",
    "View": "a view is compared as one value",
    "Writer": "writers are compared by name and order",
}
IGNORED_CLASSES = {
    "Condition": "by meaning only",
    "DeclaredParameter": "see above",
    "DeclaredTemplate": "see above",
    "Handle": "by their text only",
    "Letters": "only places",
    "PoseCondition": "see above",
    "Replacement": "see above",
    "Site": "see above",
    "Use": "see above",
    "Writer": "by name and order only",
}
DEFAULT_FIELDS = {
    *("Adaptation.dwell_s", "Conduct.phase", "Output.worse", "Parameter.variable", "Parameter.value"),
    *("Course.choose", "Course.within", "Course.otherwise", "Course.lead"),
    *("Course.smooth_s", "Course.hold_s", "Course.cooldown_s", "Course.abort_s"),
    *("TreeElement.course", "TreeElement.period_s", "TreeElement.repeat"),
    *("Loop.monitor", "Loop.analyse", "Loop.adapt", "Loop.execute"),
}
"""Fields that need no category or wording of their own: their changes are reported as `redefined`."""

PAIRING_FIELDS = {"Usage.resource", "Identification.variable", "Expectation.variable", "Expectation.expected"}
"""Fields by which entries are paired, so that they never differ. Every field `name` is such a field as well."""


@pytest.mark.parametrize("cls", [cls for cls in MODEL_CLASSES if cls.__name__ not in WHOLE_VALUE_CLASSES])
def test_every_field_has_a_line_in_the_table_or_is_compared_by_default_on_purpose(cls: type) -> None:
    unlisted_fields = [
        f"{cls.__name__}.{field.name}"
        for field in dataclasses.fields(cls)
        if field.compare
        and field.type != "Place"
        and field.name not in {**FIELD_COMPARERS[object], **FIELD_COMPARERS.get(cls, {})}
    ]

    assert {name for name in unlisted_fields if not name.endswith(".name")} - DEFAULT_FIELDS - PAIRING_FIELDS == set()


def test_lists_of_this_file_name_no_field_that_is_gone() -> None:
    field_names = {f"{cls.__name__}.{field.name}" for cls in MODEL_CLASSES for field in dataclasses.fields(cls)}

    assert field_names >= DEFAULT_FIELDS | PAIRING_FIELDS
    assert {cls.__name__ for cls in MODEL_CLASSES} >= set(WHOLE_VALUE_CLASSES)
    assert all(
        set(comparers) <= {field.name for field in dataclasses.fields(cls)}
        for cls, comparers in FIELD_COMPARERS.items()
        if dataclasses.is_dataclass(cls)
    )


@cache
def sample_plans() -> tuple[BuildPlan, ...]:
    """Plans that have a value of every class."""
    oven_plans = plan_text(BASE, "spec.yaml", CASES).plans
    knowledge_plans = plan_text((CASES / "knowledge.yaml").read_text("utf-8"), "spec.yaml", CASES).plans
    return (
        *oven_plans,
        *knowledge_plans,
        *plan_paths([CASES / "loops-everything/spec.yaml"], CASES / "loops-everything").plans,
        *plan_paths([CASES / "ros-topics/spec.yaml"], CASES / "ros-topics").plans,
    )


def add_field(value: Any, cls: type, new_class: type, field_value: object, name: str = "novel") -> Any:
    """Return a copy of a value in which all objects of a class have one more field."""
    if isinstance(value, tuple):
        return tuple(add_field(entry, cls, new_class, field_value, name) for entry in value)
    if isinstance(value, Mapping) and not isinstance(value, model.Places):
        return {key: add_field(entry, cls, new_class, field_value, name) for key, entry in value.items()}
    if not dataclasses.is_dataclass(value) or isinstance(value, type):
        return value
    fields = {
        field.name: add_field(getattr(value, field.name), cls, new_class, field_value, name)
        for field in dataclasses.fields(value)
        if field.init
    }
    return new_class(**fields, **{name: field_value}) if type(value) is cls else type(value)(**fields)


@pytest.mark.parametrize("cls", [cls for cls in MODEL_CLASSES if cls.__name__ not in IGNORED_CLASSES], ids=str)
def test_a_new_field_is_reported_without_an_edit(cls: type) -> None:
    new_class = dataclasses.make_dataclass(
        cls.__name__, [("novel", object, dataclasses.field(kw_only=True))], bases=(cls,), unsafe_hash=True
    )
    plan_pairs = ((add_field(plan, cls, new_class, 1), add_field(plan, cls, new_class, 2)) for plan in sample_plans())

    assert any(review(Version(plans=(before,)), Version(plans=(after,))).changes for before, after in plan_pairs)


@pytest.mark.parametrize("name", ["novel", "novel_s", "is_novel"])
@pytest.mark.parametrize(
    ("old", "new", "expected_texts"),
    [
        (1, 2, ("1", "2")),
        (None, 1.5, (None, "1.5")),
        ("a", "b", ("a", "b")),
        (False, True, ("false", "true")),
        (None, ("a",), (None, "a")),
        (("a", "b"), ("b",), ("a", None)),
        (model.Kind.BOOL, model.Kind.INT, ("bool", "int")),
    ],
)
def test_a_new_field_of_any_type_is_reported_by_its_key(
    name: str, old: object, new: object, expected_texts: tuple[str | None, str | None]
) -> None:
    field_definition = (name, object, dataclasses.field(kw_only=True))
    skill_class = dataclasses.make_dataclass("Skill", [field_definition], bases=(model.Skill,), unsafe_hash=True)
    plan = sample_plans()[0]
    before, after = (add_field(plan, model.Skill, skill_class, field_value, name) for field_value in (old, new))

    (change,) = review(Version(plans=(before,)), Version(plans=(after,))).changes

    old_text, new_text = (f"{value} s" if name == "novel_s" and value == "1.5" else value for value in expected_texts)
    assert (change.category, change.key) == (Category.REDEFINED, "novel")
    assert (change.message, change.old_text, change.new_text) == ("'novel' has changed", old_text, new_text)


def test_a_new_section_has_elements_that_come_and_go() -> None:
    section_fields = [("zones", object, dataclasses.field(kw_only=True))]
    spec_class = dataclasses.make_dataclass("Spec", section_fields, bases=(model.Spec,), unsafe_hash=True)
    before, after = (
        dataclasses.replace(plan, checked=dataclasses.replace(plan.checked, spec=zoned_spec))
        for plan in sample_plans()[1:2]
        for nodes in (plan.checked.spec.nodes[:2], plan.checked.spec.nodes[1:3])
        for zoned_spec in [spec_class(**{**field_values(plan.checked.spec), "zones": nodes})]
    )

    changes = review(Version(plans=(before,)), Version(plans=(after,))).changes

    removed_name, _, added_name = (node.name for node in sample_plans()[1].checked.spec.nodes[:3])
    assert [(change.category, change.element) for change in changes] == [
        (Category.REMOVED, f"picking_up/zones/{removed_name}"),
        (Category.ADDED, f"picking_up/zones/{added_name}"),
    ]


def field_values(spec: model.Spec) -> dict[str, Any]:
    return {field.name: getattr(spec, field.name) for field in dataclasses.fields(spec)}
