from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
import yaml
from hypothesis import example, given, settings
from hypothesis import strategies as st

from codra_dsl.language.load import load_spec
from codra_dsl.language.model import (
    Access,
    AnyName,
    Condition,
    Expected,
    Hysteresis,
    Isolation,
    Kind,
    Members,
    Refresh,
    WhenUnobservable,
)

from .texts import ALGORITHM, algorithm_of, findings_of, loaded, marked, rules_of, spec_of, variable_of

ROOT = Path(__file__).parents[3]
OPTIONAL = {
    "with",
    "uses",
    "given",
    "observable_when",
    "accept_when",
    "timeout",
    "min_interval",
    "isolate",
    "host",
    "rank",
}
TWICE = "templates: {two: {context: {far: {type: bool}}}}\n"


def test_the_laboratory_loads_without_findings() -> None:
    spec, findings = load_spec(ROOT / "specs" / "lab.yaml", ROOT)

    assert findings == ()
    assert spec is not None
    assert spec.files == ("specs/lab.yaml", "specs/parts/machine.yaml")
    assert (len(spec.context), len(spec.perception), len(spec.observers)) == (15, 8, 7)
    assert not any(spec.damaged.values())
    assert set(spec.origins.values()) == {"lab", "centrifuge", "pcr_cycler"}


def test_a_variable_with_only_a_type_has_the_defaults() -> None:
    variable = variable_of("type: bool")

    assert (variable.label, variable.description, variable.sources, variable.node) == ("near", "", (), "context")
    assert (variable.valid_for_s, variable.states_validity, variable.history) == (math.inf, False, 100)
    assert (variable.when_unobservable, variable.refresh) == (WhenUnobservable.KEEP, Refresh.PERIODIC)
    assert (variable.type.kind, variable.type.unit, variable.type.range, variable.type.values) == (
        Kind.BOOL,
        None,
        None,
        (),
    )


def test_a_variable_has_the_values_of_its_keys() -> None:
    variable = variable_of(
        "type: float, unit: m/s, range: [0, 36 km/h], label: Speed, description: of the base,"
        " source: [observer, drive], valid_for: 500 ms, when_unobservable: forget, refresh: on_event, history: 7,"
        " of: robot"
    )

    assert (variable.type.kind, variable.type.unit, variable.type.range) == (Kind.FLOAT, "m/s", (0, 10.0))
    assert (variable.label, variable.description, variable.node) == ("Speed", "of the base", "robot")
    assert [source.name for source in variable.sources] == ["observer", "drive"]
    assert (variable.valid_for_s, variable.states_validity, variable.history) == (0.5, True, 7)
    assert (variable.when_unobservable, variable.refresh) == (WhenUnobservable.FORGET, Refresh.ON_EVENT)


def test_enum_members_are_texts_in_order_and_never_values_of_yaml_1_1() -> None:
    assert variable_of("type: enum, values: [on, off, no, 1:30, '3']").type.values == ("on", "off", "no", "1:30", "3")


def test_every_key_and_value_of_a_variable_has_its_place() -> None:
    text = (
        "codra: 1\nname: kitchen\ncontext:\n  near:\n    type: float\n    range: [0, 1]\n"
        "    source:\n      - observer\n"
    )
    variable = spec_of(text).context[0]

    assert {key: marked(text, place) for key, place in variable.places.items()} == {
        "name": "near",
        "type": "float",
        "range": "[0, 1]",
        "source": "source",
    }
    assert marked(text, variable.place) == "near"
    assert marked(text, variable.type.places["range"]) == "[0, 1]"
    assert marked(text, variable.sources[0].place) == "observer"


def test_an_algorithm_with_only_required_keys_has_the_defaults() -> None:
    algorithm = algorithm_of("")

    assert (algorithm.timeout_s, algorithm.min_interval_s, algorithm.rank) == (5.0, 0.0, 1)
    assert algorithm.isolate is Isolation.THREAD
    assert (algorithm.parameters, algorithm.uses, algorithm.given) == ((), (), ())
    assert (algorithm.observable_when, algorithm.accept_when) == ((), ())


def test_an_algorithm_has_the_values_of_its_keys() -> None:
    algorithm = algorithm_of(
        "    with: {near: 20 cm, turn: 90 deg, name: pot, quoted: '5 s', count: 3, ratio: 0.5, fast: true, model: 3D}\n"
        "    uses: {camera: read, vision: slot, arm: command}\n"
        "    given: [pot, lid]\n"
        "    timeout: 2 min\n    min_interval: 0 s\n    isolate: process\n    host: arm_pc\n    rank: 2\n"
    )

    assert algorithm.parameters == (
        ("near", 0.2),
        ("turn", math.pi / 2),
        ("name", "pot"),
        ("quoted", "5 s"),
        ("count", 3),
        ("ratio", 0.5),
        ("fast", True),
        ("model", "3D"),
    )
    assert [(usage.resource.name, usage.access) for usage in algorithm.uses] == [
        ("camera", Access.READ),
        ("vision", Access.SLOT),
        ("arm", Access.COMMAND),
    ]
    assert [reference.name for reference in algorithm.given] == ["pot", "lid"]
    assert (algorithm.timeout_s, algorithm.min_interval_s, algorithm.rank) == (120.0, 0.0, 2)
    assert algorithm.isolate is Isolation.PROCESS
    assert algorithm.host == "arm_pc"
    assert [(returned.name, returned.type.kind, returned.optional) for returned in algorithm.returns] == [
        ("x", Kind.FLOAT, False),
        ("state", Kind.STR, False),
    ]


def test_a_variable_is_identified_by_a_condition_by_members_or_with_hysteresis() -> None:
    algorithm = algorithm_of("").identifies[0]
    text = (
        "codra: 1\nname: kitchen\ncontext: {}\nperception:\n  look:\n    call: kitchen.perception:look\n"
        "    returns: {x: {type: float}}\n    identifies:\n"
        "      door: {open: x > 3, closed: x < 1}\n"
        "      near: {enter: x > 3, leave: x < 2, confirm: 2 of 3}\n"
        "      far: {enter: x < 2}\n"
    )
    members, both, one = (entry.by for entry in spec_of(text).perception[0].identifies)

    assert isinstance(algorithm.by, Condition)
    assert isinstance(members, Members)
    assert [(member.name, condition.text) for member, condition in members.cases] == [
        ("open", "x > 3"),
        ("closed", "x < 1"),
    ]
    assert isinstance(both, Hysteresis)
    assert both.leave is not None
    assert (both.enter.text, both.leave.text, both.confirm) == ("x > 3", "x < 2", (2, 3))
    assert isinstance(one, Hysteresis)
    assert (one.leave, one.confirm) == (None, None)


def test_an_expectation_of_a_skill_becomes_a_condition_over_the_variable() -> None:
    text = (
        "codra: 1\nname: kitchen\nskills:\n  fill:\n    preview: [pot]\n    changes: [pot]\n    monitor:\n"
        "      - pot\n"
        "      - pot becomes true within 500 ms\n"
        "      - weight becomes < 0.5 kg within 1 min\n"
        "      - 'door stays \"within reach\"'\n"
    )
    skill = spec_of(text).skills[0]
    watched_expectation, becomes_expectation, compared_expectation, stays_expectation = skill.monitor

    assert ([name.name for name in skill.preview], [name.name for name in skill.changes]) == (["pot"], ["pot"])
    assert (watched_expectation.expected, watched_expectation.condition, watched_expectation.within_s) == (
        Expected.WATCHED,
        None,
        None,
    )
    assert becomes_expectation.condition is not None
    assert (becomes_expectation.expected, becomes_expectation.condition.text, becomes_expectation.within_s) == (
        Expected.BECOMES,
        "pot == true",
        0.5,
    )
    assert compared_expectation.condition is not None
    assert (compared_expectation.condition.text, compared_expectation.within_s) == ("weight < 0.5 kg", 60.0)
    assert stays_expectation.condition is not None
    assert (stays_expectation.expected, stays_expectation.condition.text) == (Expected.STAYS, 'door == "within reach"')
    assert marked(text, stays_expectation.condition.place_between(8, 22)) == '"within reach"'
    assert marked(text, compared_expectation.condition.place_between(9, 15)) == "0.5 kg"
    assert marked(text, compared_expectation.variable.place) == "weight"


def test_observers_resources_and_agents_have_the_values_of_their_keys() -> None:
    spec = spec_of(
        "codra: 1\nname: kitchen\nresources: {camera: {}, vision: {slots: 2}}\nagents: {doorbell: {}}\n"
        "observers:\n  pot: {identifies: [pot, lid], period: 2 s, priority: -3}\n  lid: {identifies: [lid]}\n"
    )

    assert [(resource.name, resource.slots) for resource in spec.resources] == [("camera", None), ("vision", 2)]
    assert [agent.name for agent in spec.agents] == ["doorbell"]
    assert [(observer.period_s, observer.priority) for observer in spec.observers] == [(2.0, -3), (1.0, 0)]
    assert [reference.name for reference in spec.observers[0].identifies] == ["pot", "lid"]


@pytest.mark.parametrize("name", ["print", "list", "self", "match", "type", "becomes", "job", "Exception", "a" * 100])
def test_names_that_are_not_keywords_are_allowed(name: str) -> None:
    assert spec_of(f"codra: 1\nname: kitchen\ncontext: {{{name}: {{type: bool}}}}\n").context[0].name == name


@pytest.mark.parametrize(
    "name", ["class", "None", "True", "__init__", "_x", "a-b", "ä", "x y", "null", "min", "known", "a" * 101, "x\\ny"]
)
def test_other_names_are_refused_and_their_elements_are_damaged(name: str) -> None:
    spec, findings = loaded(f'codra: 1\nname: kitchen\ncontext: {{"{name}": {{type: bool}}, b: {{type: bool}}}}\n')

    assert len(findings) == 1
    assert spec is not None
    assert [variable.name for variable in spec.context] == ["b"]
    assert len(spec.damaged["context"]) == 1


def test_sections_may_be_empty() -> None:
    spec = spec_of("codra: 1\nname: kitchen\ncontext:\nperception: {}\ninclude:\ntemplates:\nuse: {}\n")

    assert (spec.context, spec.perception) == ((), ())


def test_all_mistakes_of_one_element_are_reported_in_one_run() -> None:
    text = ALGORITHM + (
        "    timeout: 5\n    min_interval: soon\n    rnk: 3\n    accept_when: [x >> 3, true]\n"
        "    uses: {camera: write}\n    with: {a-b: 3, length: 5 metres}\n"
    )

    assert rules_of(text) == [
        "wrong-type",
        "duration",
        "unknown-key",
        "condition-syntax",
        "read-as-literal",
        "unknown-value",
        "ill-formed-name",
        "unit",
    ]


@pytest.mark.parametrize(
    ("keys", "damaged"),
    [
        ("timeout: 5", {"timeout"}),
        ("timeout: 5 parsecs", {"timeout"}),
        ("uses: {camera: write}", {"uses"}),
        ("given: [near, 5]", {"given"}),
        ("accept_when: [x >> 3, x > 1]", {"accept_when"}),
        ("isolate: proces", {"isolate"}),
        ("rank: one\n    min_interval: -1 s", {"rank", "min_interval"}),
        ("timout: 5 s", set()),
        ("colour: red", OPTIONAL),
    ],
)
def test_a_damaged_key_has_its_default_and_the_rest_of_the_element_is_kept(keys: str, damaged: set[str]) -> None:
    spec, findings = loaded(ALGORITHM + f"    {keys}\n")

    assert findings
    assert spec is not None
    (algorithm,) = spec.perception
    assert (algorithm.call, algorithm.timeout_s, algorithm.isolate) == (
        "kitchen.perception:look",
        5.0,
        Isolation.THREAD,
    )
    assert [entry.variable.name for entry in algorithm.identifies] == ["near"]
    assert spec.damaged_keys.get(("perception", "look"), frozenset()) == damaged
    assert spec.damaged["perception"] == ({"look"} if damaged else set())
    assert spec.damaged["context"] == frozenset()


@pytest.mark.parametrize(
    ("old", "new", "damaged"),
    [
        ("x: {type: float}", "x: {type: flot}", {"returns.x"}),
        ("x: {type: float}", "x: float", {"returns.x"}),
        ("x: {type: float}", "x: {type: float, unit: parsec}", {"returns.x"}),
        ("near: x > 3", "near: x > ", {"identifies.near"}),
        ("near: x > 3", "near: {leave: x < 3}", {"identifies.near"}),
        ("kitchen.perception:look", "kitchen.look", {"call"}),
    ],
)
def test_a_damaged_entry_of_returns_or_identifies_does_not_affect_the_others(
    old: str, new: str, damaged: set[str]
) -> None:
    spec, findings = loaded(ALGORITHM.replace(old, new))

    assert len(findings) == 1
    assert spec is not None
    (algorithm,) = spec.perception
    assert [returned.name for returned in algorithm.returns] == ["x", "state"]
    assert [entry.variable.name for entry in algorithm.identifies] == ["near"]
    assert spec.damaged_keys["perception", "look"] == damaged


def test_an_element_declared_twice_is_damaged_in_every_key() -> None:
    spec, _ = loaded(ALGORITHM + "use: {one: {template: two}, three: {template: two}}\n" + TWICE)

    assert spec is not None
    assert [variable.name for variable in spec.context] == ["near", "far"]
    assert spec.damaged["context"] == {"far"}
    assert {"type", "source", "valid_for"} <= spec.damaged_keys["context", "far"]


@pytest.mark.parametrize("text", ["context: [a]", "things: [a]", "use: {a: {template: b}}"])
def test_if_elements_are_lost_every_name_counts_as_damaged(text: str) -> None:
    spec, findings = loaded(f"codra: 1\nname: kitchen\n{text}\n")

    assert findings
    assert spec is not None
    assert isinstance(spec.damaged["context"], AnyName)
    assert "any_name" in spec.damaged["context"]
    assert bool(spec.damaged["context"])


def test_a_misspelt_section_is_read_as_the_intended_one() -> None:
    spec, findings = loaded("codra: 1\nname: kitchen\ncontxt: {near: {type: bool}}\n")

    assert [finding.rule.name for finding in findings] == ["unknown-key"]
    assert spec is not None
    assert [variable.name for variable in spec.context] == ["near"]


def test_a_spec_with_any_error_counts_as_damaged_itself() -> None:
    spec, _ = loaded("name: kitchen\ncodra: 1\ncontext: {near: {type: bool}}\n")

    assert spec is not None
    assert spec.damaged["spec"] == {"kitchen"}


def test_a_syntax_error_is_the_only_finding() -> None:
    spec, findings = loaded("codra: 1\nname: kitchen\nname: twice\ncontext: {a: b\n  c: d}\n")

    assert spec is None
    assert [finding.rule.name for finding in findings] == ["yaml-syntax"]


def test_paths_of_findings_contain_names_and_no_lines() -> None:
    text = ALGORITHM + "    uses: {camera: write}\n    accept_when: [x >> 3]\n"

    assert [finding.path for finding in findings_of(text)] == [
        "perception.look.uses.camera",
        "perception.look.accept_when.0",
    ]


WORDS = st.text("abcdefghijklmnopqrstuvwxyz", min_size=3, max_size=8).filter(lambda word: rules_of_name(word) == [])
VARIABLES = st.fixed_dictionaries(
    {"type": st.sampled_from(["bool", "int", "float", "str"])},
    optional={
        "label": st.text(
            st.characters(codec="utf-8", exclude_categories=["C", "Z"], exclude_characters="$"), min_size=1
        ).map(str),
        "description": st.text(
            st.characters(codec="ascii", exclude_categories=["C"], exclude_characters="$"), max_size=60
        ),
        "source": WORDS | st.lists(WORDS, min_size=1, max_size=3, unique=True),
        "valid_for": st.sampled_from(["forever", "5 s", "500 ms", "2 min", "1.5 h"]),
        "when_unobservable": st.sampled_from(["keep", "forget"]),
        "refresh": st.sampled_from(["periodic", "on_event"]),
        "history": st.integers(1, 1_000_000),
        "of": WORDS,
    },
)


def rules_of_name(word: str) -> list[str]:
    return rules_of(f"codra: 1\nname: {word}\n")


class CoreDumper(yaml.SafeDumper):
    """Quotes texts such as `0E0` and `0o7`, which are numbers in YAML 1.2 but not in YAML 1.1, which PyYAML writes."""


CoreDumper.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"(?:[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?|0o[0-7]+)$"),
    list("-+.0123456789"),
)


@settings(max_examples=25)
@example({"near": {"type": "bool", "label": "0E0"}}, None, 20)
@given(st.dictionaries(WORDS, VARIABLES, max_size=6), st.booleans() | st.none(), st.integers(20, 200))
def test_a_dumped_spec_loads_with_the_same_values(
    variables: dict[str, dict[str, object]], flow: bool | None, width: int
) -> None:
    content = {"codra": 1, "name": "kitchen", "context": variables}
    dumped_text = yaml.dump(
        content, Dumper=CoreDumper, default_flow_style=flow, width=width, sort_keys=False, allow_unicode=True
    )
    loaded_variables = {variable.name: variable for variable in spec_of(dumped_text).context}

    assert list(loaded_variables) == list(variables)
    for name, keys in variables.items():
        variable, sources = loaded_variables[name], keys.get("source", [])
        assert variable.type.kind.value == keys["type"]
        assert variable.label == keys.get("label", name)
        assert variable.description == keys.get("description", "")
        assert [source.name for source in variable.sources] == ([sources] if isinstance(sources, str) else sources)
        assert (variable.history, variable.node) == (keys.get("history", 100), keys.get("of", "context"))
        assert {key: marked(dumped_text, variable.places[key]) for key in ("type", "history") if key in keys} == {
            key: str(keys[key]) for key in ("type", "history") if key in keys
        }
