from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.language.expression import Text, names_in, walk
from codra_dsl.language.load import load_text
from codra_dsl.language.model import Algorithm, Spec

from .texts import findings_of, loaded, marked, rules_of, spec_of

TEMPLATE = """
codra: 1
name: kitchen
templates:
  jar:
    parameters: {PARAMETERS}
    context:
      $(instance)_full: {type: bool}
    perception:
      look_into_$(instance):
        call: kitchen.perception:look
        returns: {level: {type: float, range: [0, 10]}, state: {type: str}}
        identifies: {$(instance)_full: level > 3}
KEYS
use:
  sugar: {template: jar, ARGUMENTS}
"""


def template_text(parameters: str, arguments: str, *keys: str) -> str:
    text = TEMPLATE.replace("PARAMETERS", parameters).replace(", ARGUMENTS", f", {arguments}" if arguments else "")
    return text.replace("KEYS", "\n".join(f"        {key}" for key in keys))


def look(parameters: str, arguments: str, *keys: str) -> Algorithm:
    return spec_of(template_text(parameters, arguments, *keys)).perception[0]


def test_the_name_of_the_use_may_be_part_of_any_name() -> None:
    text = template_text("", "", "observable_when: [known($(instance)_full)]", "uses: {camera_of_$(instance): read}")
    spec = spec_of(text)
    (condition,) = spec.perception[0].observable_when
    assert condition.tree is not None
    (name,) = names_in(condition.tree)

    assert [variable.name for variable in spec.context] == ["sugar_full"]
    assert (spec.perception[0].name, spec.perception[0].identifies[0].variable.name) == (
        "look_into_sugar",
        "sugar_full",
    )
    assert spec.perception[0].uses[0].resource.name == "camera_of_sugar"
    assert condition.text == "known(sugar_full)"
    assert marked(text, condition.place_of(name)) == "$(instance)_full"
    assert spec.origins["perception", "look_into_sugar"] == "sugar"
    assert [(use.instance, use.template) for use in spec.uses] == [("sugar", "jar")]


def test_elements_of_a_template_have_two_places() -> None:
    text = template_text("", "")
    variable = spec_of(text).context[0]

    assert marked(text, variable.place) == "$(instance)_full"
    assert variable.place.use is not None
    assert marked(text, variable.place.use) == "sugar"


def test_a_parameter_as_a_complete_value_binds_the_literal() -> None:
    keys = (
        "rank: $(rank)",
        "timeout: $(limit)",
        "with: {n: $(rank), far: $(far), on: $(on), name: $(name), q: $(name), i: $(instance)}",
    )
    parameters = "rank: int, limit: quantity, far: {type: quantity, default: 20 cm}, on: bool, name: str"
    algorithm = look(parameters, "rank: 2, limit: 500 ms, on: false, name: 5 s", *keys)

    assert (algorithm.rank, algorithm.timeout_s) == (2, 0.5)
    assert dict(algorithm.parameters) == {"n": 2, "far": 0.2, "on": False, "name": "5 s", "q": "5 s", "i": "sugar"}


def test_a_literal_in_a_condition_is_written_in_the_condition_language() -> None:
    keys = ("accept_when:", "  - level > $(low) and level > $(deep) and known(level) == $(on) and state == $(name)")
    algorithm = look(
        "low: float, deep: quantity, on: bool, name: str", "low: -1.5, deep: 2 cm, on: true, name: it's \\", *keys
    )

    assert algorithm.accept_when[0].text == (
        'level > -1.5 and level > 2 cm and known(level) == true and state == "it\'s \\\\"'
    )


def test_labels_and_texts_take_any_parameter_anywhere() -> None:
    text = (
        "codra: 1\nname: kitchen\ntemplates:\n  jar:\n    parameters: {title: str, size: float}\n    context:\n"
        "      $(instance)_full:\n        type: bool\n        label: $(title)_full ($(size))\n"
        "        description: $(size)\nuse:\n  sugar: {template: jar, title: Sugar jar, size: 2}\n"
    )
    variable = spec_of(text).context[0]

    assert (variable.label, variable.description) == ("Sugar jar_full (2)", "2")
    algorithm = look("title: str", "title: a b", "with: {topic: /$(instance)/$(title)}")
    assert algorithm.parameters == (("topic", "/sugar/a b"),)


def test_between_quotes_in_a_condition_a_parameter_is_text() -> None:
    algorithm = look("name: str, n: int", "name: 'the \"best\"', n: 3", "accept_when: ['state == \"$(name) $(n)\"']")
    (condition,) = algorithm.accept_when
    assert condition.tree is not None

    assert [part.value for part in walk(condition.tree) if isinstance(part, Text)] == ['the "best" 3']


@given(
    st.text(
        st.characters(codec="utf-8", exclude_categories=["C", "Zl", "Zp"]) | st.sampled_from("\n\t\\\"'"), max_size=20
    )
)
def test_texts_of_a_use_cannot_break_out_of_a_condition(value: str) -> None:
    import yaml

    argument = yaml.safe_dump(value, default_style='"', width=10_000, allow_unicode=True).strip()
    text = template_text("name: str", f"name: {argument}", "accept_when: ['state == \"$(name)\"', state == $(name)]")
    spec, findings = loaded(text)
    if any(finding.rule.name == "control-character" for finding in findings):
        return

    assert findings == ()
    assert spec is not None
    for condition in spec.perception[0].accept_when:
        assert condition.tree is not None
        assert [part.value for part in walk(condition.tree) if isinstance(part, Text)] == [value]


@pytest.mark.parametrize(
    "key",
    [
        "accept_when: [level > $(n)_x]",
        "accept_when: [level > x$(n)]",
        "accept_when: [level > $(n)$(n)]",
        "accept_when: [known$(n)]",
        "call: kitchen.perception:look_$(n)",
        "uses: {camera_$(n): read}",
        "timeout: $(n) s",
        "given: [a_$(n)]",
    ],
)
def test_only_an_identifier_may_be_part_of_a_name(key: str) -> None:
    text = template_text("n: int", "n: 3", key)
    text = text.replace("        call: kitchen.perception:look\n", "") if key.startswith("call") else text

    assert set(rules_of(text)) == {"parameter-in-name"}


@pytest.mark.parametrize("text", ["$( n )", "$()", "$(n", "$(1)", "$(a-b)", "$(n.m)"])
def test_a_malformed_parameter_is_reported(text: str) -> None:
    assert rules_of(template_text("", "", f"accept_when: ['level > {text}']")) == ["ill-formed-parameter"]


@pytest.mark.parametrize("argument", ["'true'", "3.5", "'3'", "three", "[3]", "~"])
def test_an_argument_must_have_its_parameters_type(argument: str) -> None:
    findings = findings_of(template_text("rank: int", f"rank: {argument}", "rank: $(rank)"))

    assert [finding.rule.name for finding in findings] == [
        "wrong-type" if argument in ("[3]", "~") else "ill-typed-argument"
    ]


@pytest.mark.parametrize("argument", ["class", "a b", "min", "3", "ä"])
def test_an_identifier_must_be_a_name(argument: str) -> None:
    rules = rules_of(template_text("other: identifier", f"other: {argument}", "given: [$(other)_full]"))

    assert rules == ["ill-typed-argument"]


def test_a_mistake_in_a_template_is_reported_once_with_all_its_uses() -> None:
    text = template_text("", "", "timeout: 5", "min_interval: 5 seconds", "accept_when: [level >> 3]") + (
        "  salt: {template: jar}\n  tea: {template: jar}\n"
    )
    findings_by_rule = {finding.rule.name: finding for finding in findings_of(text)}

    assert list(findings_by_rule) == ["wrong-type", "duration", "condition-syntax"]
    assert findings_by_rule["wrong-type"].place.use is None
    assert marked(text, findings_by_rule["duration"].place) == "5 seconds"
    uses = [findings_by_rule["duration"].place, *(related.place for related in findings_by_rule["duration"].related)]
    assert [use.use and marked(text, use.use) for use in uses] == ["sugar", "salt", "tea"]


def test_the_mistakes_of_a_template_without_uses_are_reported() -> None:
    used = template_text(
        "n: int", "n: 3", "timeout: 5", "min_interval: 5 seconds", "accept_when: [level >> $(n)]", "rank: $(n)"
    )

    assert rules_of(used.split("use:")[0]) == rules_of(used)


def test_mistakes_that_depend_on_a_use_are_not_reported_for_a_template_without_uses() -> None:
    text = template_text("s: str, q: quantity, n: int", "n: 3", "timeout: $(s)", "min_interval: $(q)", "rank: $(n)")

    assert rules_of(text.split("use:")[0]) == []


def test_a_wrong_use_creates_no_elements_but_its_names_are_known() -> None:
    spec, findings = loaded(template_text("n: int", "", "rank: $(n)"))

    assert [finding.rule.name for finding in findings] == ["missing-argument"]
    assert spec is not None
    assert (spec.context, spec.uses) == ((), ())
    assert spec.damaged["context"] == {"sugar_full"}
    assert spec.damaged["perception"] == {"look_into_sugar"}


def test_a_misspelt_argument_is_not_missing_as_well() -> None:
    assert rules_of(template_text("minimum: int", "minimun: 3", "rank: $(minimum)")) == ["unknown-argument"]


def test_files_and_uses_go_to_modules_of_different_names(tmp_path: Path) -> None:
    for name in ("jar.yaml", "a/jar.yaml", "b/Jar.yaml", "my-parts.yaml", "class.yaml"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        stem = name.replace("/", "_").replace("-", "_").removesuffix(".yaml")
        path.write_text(f"codra: 1\nresources: {{camera_{stem}: {{}}}}\n")
    text = (
        "codra: 1\nname: kitchen\ninclude: [jar.yaml, a/jar.yaml, b/Jar.yaml, my-parts.yaml, class.yaml]\n"
        "templates: {pot: {resources: {$(instance)_lid: {}}}}\nuse: {jar: {template: pot}, spec: {template: pot}}\n"
    )
    spec, findings = load_text(text, "kitchen.yaml", tmp_path)

    assert findings == ()
    assert isinstance(spec, Spec)
    modules = [module for (section, _), module in spec.origins.items() if section == "resources"]
    assert modules == ["jar_2", "a_jar", "b_Jar", "my_parts", "spec_class", "jar", "spec"]


def test_many_uses_of_a_large_template_end_with_one_finding() -> None:
    large = "\n".join(f"      $(instance)_{n}: {{type: bool}}" for n in range(2_000))
    uses = "\n".join(f"  jar{n}: {{template: jar}}" for n in range(1_200))
    text = f"codra: 1\nname: kitchen\ntemplates:\n  jar:\n    context:\n{large}\nuse:\n{uses}\n"

    assert rules_of(text) == ["too-many-values"]


def test_parameters_that_make_a_text_too_long_are_reported() -> None:
    long = "x" * 60_000
    text = (
        "codra: 1\nname: kitchen\ntemplates:\n  jar:\n    parameters: {t: str}\n    context:\n"
        f"      $(instance): {{type: bool, label: {'$(t)' * 1000}}}\nuse:\n  sugar: {{template: jar, t: {long}}}\n"
    )

    assert rules_of(text) == ["text-too-long"]
