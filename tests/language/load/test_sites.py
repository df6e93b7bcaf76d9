"""Sites: a spec with the values of a site is the spec in which these values are written in their place."""

from __future__ import annotations

import copy
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import FrameType
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.compiler import Planned, lint_paths, plan_paths
from codra_dsl.generation.emit.records import model_digest
from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.language.load import load_spec
from codra_dsl.language.load.site.both_files import name_both_files
from codra_dsl.language.load.yaml.rules import RULES
from codra_dsl.language.model import Spec
from tests.language.load.texts import marked

SPEC = """\
codra: 1
name: door
include: [parts/light.yaml]
context:
  door_near: {type: bool, when_unobservable: forget}
resources:
  camera: {}
  arm: {slots: 2}
perception:
  measure:
    call: some_robot.doors:measure
    uses: {camera: read, arm: slot}
    with: {gain: 2}
    timeout: 1 s
    returns:
      distance: {type: float, unit: m}
    observable_when: [known(light)]
    identifies: {door_near: distance < 2 m}
templates:
  door:
    parameters: {angle: quantity, limit: {type: int, default: 2}}
    context:
      $(instance)_open: {type: bool, valid_for: 30 s}
    perception:
      look_at_$(instance):
        call: some_robot.doors:look
        uses: {camera: read}
        timeout: 2 s
        returns:
          angle: {type: float, unit: rad, optional: true}
          edges: {type: int, range: [0, 20]}
        observable_when: [light > 20 lux, door_near]
        accept_when: [edges >= $(limit)]
        identifies: {$(instance)_open: angle > $(angle)}
use:
  north: {template: door, angle: 30 deg}
  south: {template: door, angle: 30 deg}
skills:
  open_door: {preview: [north_open, south_open], changes: [north_open]}
observers:
  near: {identifies: [door_near], period: 500 ms}
"""
PART = """\
codra: 1
context:
  light: {type: float, unit: lux, range: [0, 2000], source: main_execution, valid_for: 1 min}
"""
SITE = "sites/hall.yaml"


def project(folder: Path, site: str, spec: str = SPEC) -> Path:
    files = {"pyproject.toml": "[tool.codra]\n", "specs/door.yaml": spec, "specs/parts/light.yaml": PART, SITE: site}
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, "utf-8")
    return folder


def site_of(keys: str) -> str:
    return f"codra: 1\noverlays: door\n{keys}"


def planned(folder: Path, keys: str) -> Planned:
    root = project(folder, site_of(keys))
    return plan_paths([root / "specs"], root, sites=[root / SITE])


def findings_of(folder: Path, keys: str) -> list[Diagnostic]:
    """Return the findings about the spec with a site; the spec alone has none."""
    return list(planned(folder, keys).diagnostics)


def spec_of(folder: Path, keys: str) -> Spec:
    result = planned(folder, keys)
    assert result.diagnostics == ()
    return result.plans[0].checked.spec


def related(finding: Diagnostic) -> list[tuple[str, str, int]]:
    """Return the messages about other places, with their files and lines."""
    return [(other.message, other.place.span.file, other.place.span.line) for other in finding.related]


# Values


def test_a_site_replaces_scalars_and_complete_lists_and_keeps_the_rest(tmp_path: Path) -> None:
    spec = spec_of(
        tmp_path,
        "context:\n  light: {range: [0, 4000]}\nperception:\n  measure:\n    timeout: 3 s\n    with: {gain: 5}\n"
        "  look_at_south: {observable_when: [light > 50 lux]}\n",
    )
    algorithms = {algorithm.name: algorithm for algorithm in spec.perception}
    light = next(variable for variable in spec.context if variable.name == "light")

    assert (light.type.range, light.valid_for_s) == ((0, 4000), 60)
    assert (algorithms["measure"].timeout_s, algorithms["measure"].parameters) == (3, (("gain", 5),))
    assert [condition.text for condition in algorithms["look_at_south"].observable_when] == ["light > 50 lux"]
    assert [condition.text for condition in algorithms["look_at_north"].observable_when] == [
        "light > 20 lux",
        "door_near",
    ]


def test_a_site_states_keys_that_the_spec_leaves_to_their_defaults(tmp_path: Path) -> None:
    spec = spec_of(tmp_path, "observers: {near: {priority: 3}}\nperception: {measure: {min_interval: 2 s}}\n")

    assert spec.observers[0].priority == 3
    assert spec.perception[0].min_interval_s == 2


def test_arguments_of_uses_are_replaced_before_templates_are_expanded(tmp_path: Path) -> None:
    spec = spec_of(tmp_path, "use: {north: {angle: 50 deg, limit: 4}}\n")
    texts = {
        algorithm.name: (algorithm.accept_when[0].text, str(algorithm.identifies[0].by.text))  # type: ignore[union-attr]
        for algorithm in spec.perception
        if algorithm.name.startswith("look")
    }

    assert texts == {
        "look_at_north": ("edges >= 4", "angle > 50 deg"),
        "look_at_south": ("edges >= 2", "angle > 30 deg"),
    }


def test_each_replaced_value_has_its_place_in_the_site_and_knows_the_place_in_the_spec(tmp_path: Path) -> None:
    keys = "context:\n  light: {valid_for: 2 min}\n  north_open: {valid_for: 9 s}\nuse:\n  south: {limit: 7}\n"
    spec = spec_of(tmp_path, keys)
    assert spec.site is not None
    values = {
        (value.section, value.name, value.key): (
            marked(site_of(keys), value.place),
            None if value.replaced is None else (value.replaced.span.file, value.replaced.span.line),
        )
        for value in spec.site.replacements
    }

    assert values == {
        ("context", "light", "valid_for"): ("2 min", ("specs/parts/light.yaml", 3)),
        ("context", "north_open", "valid_for"): ("9 s", ("specs/door.yaml", 23)),
        ("use", "south", "limit"): ("7", None),
    }
    assert spec.files == ("specs/door.yaml", "specs/parts/light.yaml", SITE)


SLOTS: Sequence[tuple[tuple[str, ...], Sequence[object]]] = [
    (("context", "door_near", "when_unobservable"), ["keep"]),
    (("context", "door_near", "valid_for"), ["3 s", "forever"]),
    (("resources", "arm", "slots"), [1, 4]),
    (("perception", "measure", "call"), ["some_robot.halls:measure"]),
    (("perception", "measure", "timeout"), ["2 s", "900 ms"]),
    (("perception", "measure", "with"), [{"gain": 7}]),
    (("perception", "measure", "uses", "arm"), ["slot"]),
    (("perception", "measure", "observable_when"), [["light > 3 lux", "light < 900 lux"], []]),
    (("perception", "measure", "identifies", "door_near"), ["distance < 3 m", {"enter": "distance < 1 m"}]),
    (("perception", "measure", "returns", "distance", "range"), [[0, 9]]),
    (("skills", "open_door", "preview"), [["south_open"]]),
    (("observers", "near", "period"), ["2 s"]),
    (("observers", "near", "priority"), [2]),
    (("use", "north", "angle"), ["20 deg", "0.5 rad"]),
    (("use", "south", "limit"), [5]),
]
"""Places in a spec, each with the values that a site may state."""


def put(values: dict[str, Any], path: Sequence[str], value: object) -> None:
    for step in path[:-1]:
        values = values.setdefault(step, {})
    is_merged = isinstance(values.get(path[-1]), dict) and isinstance(value, dict)
    values[path[-1]] = {**values[path[-1]], **value} if is_merged and isinstance(value, dict) else value


BASE: Mapping[str, Any] = {
    "codra": 1,
    "name": "door",
    "include": ["parts/light.yaml"],
    "context": {"door_near": {"type": "bool", "when_unobservable": "forget"}},
    "resources": {"camera": {}, "arm": {"slots": 2}},
    "perception": {
        "measure": {
            "call": "some_robot.doors:measure",
            "uses": {"camera": "read", "arm": "slot"},
            "with": {"gain": 2},
            "timeout": "1 s",
            "returns": {"distance": {"type": "float", "unit": "m"}},
            "observable_when": ["known(light)"],
            "identifies": {"door_near": "distance < 2 m"},
        }
    },
    "templates": {
        "door": {
            "parameters": {"angle": "quantity", "limit": {"type": "int", "default": 2}},
            "context": {"$(instance)_open": {"type": "bool", "valid_for": "30 s"}},
            "perception": {
                "look_at_$(instance)": {
                    "call": "some_robot.doors:look",
                    "uses": {"camera": "read"},
                    "returns": {"angle": {"type": "float", "unit": "rad"}, "edges": {"type": "int", "range": [0, 20]}},
                    "accept_when": ["edges >= $(limit)"],
                    "identifies": {"$(instance)_open": "angle > $(angle)"},
                }
            },
        }
    },
    "use": {"north": {"template": "door", "angle": "30 deg"}, "south": {"template": "door", "angle": "30 deg"}},
    "skills": {"open_door": {"preview": ["north_open", "south_open", "door_near"], "changes": ["north_open"]}},
    "observers": {"near": {"identifies": ["door_near"], "period": "500 ms"}},
}


@settings(max_examples=15, deadline=None)
@given(data=st.data())
def test_a_spec_at_a_site_means_the_same_as_the_spec_with_the_values_written_into_it(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    chosen = data.draw(st.lists(st.sampled_from(SLOTS), unique_by=lambda slot: slot[0]), label="places")
    edited: dict[str, Any] = copy.deepcopy(dict(BASE))
    site: dict[str, Any] = {"codra": 1, "overlays": "door"}
    for path, values in chosen:
        value = data.draw(st.sampled_from(list(values)), label=".".join(path))
        put(edited, path, value)
        put(site, path, value)
    root = project(tmp_path_factory.mktemp("project"), json.dumps(site), json.dumps(BASE))
    at_site = plan_paths([root / "specs/door.yaml"], root, sites=[root / SITE])
    written = plan_paths([root / "specs/door.yaml"], root, {"specs/door.yaml": json.dumps(edited).encode()})

    assert [model_digest(plan) for plan in at_site.plans] == [model_digest(plan) for plan in written.plans]
    assert sorted((finding.code, finding.message) for finding in at_site.diagnostics) == sorted(
        (finding.code, finding.message) for finding in written.diagnostics
    )


# Findings


@pytest.mark.parametrize(
    ("keys", "message", "help_text"),
    [
        ("context: {lihgt: {}}", "spec 'door' has no context-variable 'lihgt'", "did you mean 'light'?"),
        ("use: {nort: {limit: 3}}", "spec 'door' has no use 'nort'", "did you mean 'north'?"),
        (
            "perception: {measure: {with: {gian: 3}}}",
            "perception algorithm 'measure' has no 'gian' under 'with'",
            "did you mean 'gain'?",
        ),
        (
            "perception: {look_at_north: {with: {gain: 3}}}",
            "perception algorithm 'look_at_north' has no 'with'",
            "a site adds nothing to the spec, which has 'call', 'uses', 'timeout'",
        ),
        (
            "perception: {measure: {returns: {distance: {range: [0, 3]}, angle: {type: float}}}}",
            "perception algorithm 'measure' has no 'angle' under 'returns'",
            "a site adds nothing to the spec, which has 'distance'",
        ),
        (
            "resources: {hand: {call: hands:Hand}}",
            "spec 'door' has no resource 'hand'",
            "a site adds nothing to the spec, which has 'camera', 'arm'",
        ),
        ("loops: {mission: {period: 1 s}}", "spec 'door' has no loop 'mission'", "a site adds nothing to the spec"),
    ],
)
def test_a_name_that_the_spec_does_not_have_is_an_error_with_a_suggestion(
    keys: str, message: str, help_text: str, tmp_path: Path
) -> None:
    (finding,) = findings_of(tmp_path, keys)

    assert (finding.rule.name, finding.message) == ("not-in-spec", message)
    assert finding.help.startswith(help_text)
    assert (finding.place.span.file, finding.related[0].place.span.file) == (SITE, "specs/door.yaml")


@pytest.mark.parametrize(
    ("keys", "rule", "written", "line"),
    [
        ("perception:\n  measure: {timeout: 3 apples}\n", "duration", "3 apples", 14),
        ("perception:\n  measure: {call: doors}\n", "call", "doors", 11),
        ("context:\n  door_near: {type: bol}\n", "unknown-value", "bol", 5),
        ("perception:\n  look_at_north:\n    observable_when:\n    - light > dark\n", "unknown-variable", "dark", 32),
        ("use:\n  north: {angle: '30'}\n", "ill-typed-argument", "'30'", 36),
        ("skills:\n  open_door: {preview: [nord_open]}\n", "unknown-variable", "nord_open", 39),
    ],
)
def test_a_finding_about_a_value_of_the_site_is_in_the_site_and_names_the_place_in_the_spec(
    keys: str, rule: str, written: str, line: int, tmp_path: Path
) -> None:
    (finding,) = findings_of(tmp_path, keys)

    assert (finding.rule.name, finding.place.span.file) == (rule, SITE)
    assert marked(site_of(keys), finding.place) == written
    assert related(finding)[-1] == ("it replaces this value of the spec", "specs/door.yaml", line)


def test_a_finding_about_the_spec_that_only_the_site_causes_names_the_value_of_the_site(tmp_path: Path) -> None:
    keys = "resources:\n  camera: {slots: 1}\nobservers:\n  near: {priority: 2}\n"
    findings = findings_of(tmp_path, keys)

    assert {finding.rule.name for finding in findings} == {"misused-resource"}
    for finding in findings:
        assert finding.place.span.file == "specs/door.yaml"
        assert related(finding)[-1] == ("only with this value of the site", SITE, 4)


def test_the_second_declaration_of_a_name_is_read_without_the_site(tmp_path: Path) -> None:
    again = "context:\n  light: {type: float, source: main_execution}\n"
    spec = SPEC.replace("context:\n", again, 1)
    root = project(tmp_path, site_of("context: {light: {valid_for: 3 apples}}\n"), spec)
    (root / "specs/parts/light.yaml").write_text(PART.replace("1 min", "2 apples"), "utf-8")
    findings = plan_paths([root / "specs"], root, sites=[root / SITE]).diagnostics

    wrong_values = [finding.message[-10:] for finding in findings if finding.rule.name == "duration"]
    assert sorted(wrong_values) == ["'2 apples'", "'3 apples'"]


@pytest.mark.parametrize("valid_for", ["5", "1 ms"])
def test_the_work_for_naming_both_files_grows_with_the_number_of_values(valid_for: str, tmp_path: Path) -> None:
    """A value that cannot be read has a finding in the site; a validity that is too short has one in the spec."""
    call_count = 0

    def count(_: FrameType, event: str, __: object) -> None:
        nonlocal call_count
        call_count += event in ("call", "c_call")

    def work(number_of_values: int) -> int:
        nonlocal call_count
        numbers = range(number_of_values)
        variables = "".join(f"  door_{number}: {{type: bool, source: main_execution}}\n" for number in numbers)
        values = "".join(f"  door_{number}: {{valid_for: {valid_for}}}\n" for number in numbers)
        root = project(tmp_path, site_of(f"context:\n{values}"), f"codra: 1\nname: door\ncontext:\n{variables}")
        spec, findings = load_spec(root / "specs/door.yaml", root, site=root / SITE)
        assert spec is not None
        assert spec.site is not None
        diagnostics = findings or [
            Diagnostic(rule=RULES["duration"], message=f"'{variable.name}' is wrong", place=variable.place)
            for variable in spec.context
        ]
        call_count, before = 0, sys.getprofile()
        sys.setprofile(count)
        try:
            named = list(name_both_files(diagnostics, (), spec))
        finally:
            sys.setprofile(before)
        assert [len(finding.related) for finding in named] == [1] * number_of_values
        return call_count

    assert work(200) < 5 * work(50)


def test_an_argument_that_makes_a_template_wrong_is_named_with_the_text_of_the_template(tmp_path: Path) -> None:
    (finding,) = findings_of(tmp_path, "use:\n  north: {angle: 50 m}\n")

    assert (finding.rule.name, finding.place.span.line) == ("mismatched-units", 34)
    assert related(finding) == [("only with this value of the site", SITE, 4)]


def test_only_the_argument_in_the_place_of_a_finding_is_named(tmp_path: Path) -> None:
    (finding,) = findings_of(tmp_path, "use:\n  north:\n    limit: 3\n    angle: 50 m\n")

    assert related(finding) == [("only with this value of the site", SITE, 6)]


def test_findings_that_the_spec_has_without_the_site_are_reported_once_and_unchanged(tmp_path: Path) -> None:
    spec = SPEC.replace("preview: [north_open, south_open]", "preview: [north_open, south_opne]")
    root = project(tmp_path, site_of("context: {light: {valid_for: 2 min}}\n"), spec)
    alone = lint_paths([root / "specs"], root)
    with_site = lint_paths([root / "specs", root / "sites"], root)

    assert [finding.rule.name for finding in alone.diagnostics] == ["unknown-variable"]
    assert with_site.diagnostics == alone.diagnostics


@pytest.mark.parametrize(
    ("keys", "rule", "written", "line"),
    [
        ("perception: {measure: {timeut: 3 s}}\n", "unknown-key", "timeut", 10),
        ("skills: {open_door: {previews: []}}\n", "unknown-key", "previews", 39),
        ("use: {north: {template: gate}}\n", "misplaced-key", "template", 36),
        ("use: {north: {limt: 3}}\n", "unknown-argument", "limt", 20),
    ],
)
def test_a_key_that_a_site_cannot_state_is_an_error_in_the_site(
    keys: str, rule: str, written: str, line: int, tmp_path: Path
) -> None:
    (finding,) = findings_of(tmp_path, keys)

    assert (finding.rule.name, marked(site_of(keys), finding.place)) == (rule, written)
    assert [(file, number) for _, file, number in related(finding)] == [("specs/door.yaml", line)]


def test_the_unsaved_text_of_a_site_replaces_its_file(tmp_path: Path) -> None:
    root = project(tmp_path, site_of("context: {light: {valid_for: 2 min}}\n"))
    texts = {SITE: site_of("context: {lihgt: {valid_for: 2 min}}\n").encode()}
    findings = lint_paths([root / "specs", root / "sites"], root, texts).diagnostics

    assert [finding.message for finding in findings] == ["spec 'door' has no context-variable 'lihgt'"]


def test_a_parameter_in_a_site_is_refused(tmp_path: Path) -> None:
    findings = findings_of(tmp_path, "context: {light: {label: $(instance)}, $(instance)_open: {valid_for: 3 s}}\n")

    assert [finding.rule.name for finding in findings] == ["parameter-outside-template"] * 2


@pytest.mark.parametrize(
    "text",
    [
        "",
        "codra: 2\noverlays: door\n",
        "overlays: door\n",
        "codra: 1\noverlays: [door]\n",
        "codra: 1\noverlays: {",
        "\0",
    ],
)
def test_a_file_that_cannot_be_read_as_a_site_is_reported_and_the_spec_is_not_planned_for_it(
    text: str, tmp_path: Path
) -> None:
    root = project(tmp_path, text)
    result = plan_paths([root / "specs"], root, sites=[root / SITE])

    assert {finding.place.span.file for finding in result.diagnostics} == {SITE}


def test_the_help_about_an_empty_site_names_its_keys(tmp_path: Path) -> None:
    root = project(tmp_path, "")
    (finding,) = plan_paths([root / "specs"], root, sites=[root / SITE]).diagnostics

    assert finding.help == "begin it with 'codra: 1' and 'overlays: ...'"


def test_a_site_outside_of_the_project_is_not_read(tmp_path: Path) -> None:
    root = project(tmp_path / "project", site_of(""))
    (tmp_path / "outside.yaml").write_text(site_of("context: {light: {valid_for: 2 min}}\n"))
    (root / SITE).unlink()
    (root / SITE).symlink_to(tmp_path / "outside.yaml")
    _, findings = load_spec(root / "specs/door.yaml", root, site=root / SITE)

    assert [finding.rule.name for finding in findings] == ["cannot-read"]


@pytest.mark.parametrize(
    ("text", "rules"),
    [
        ('{"codra": 1, "overlays": "door", "context": {"light": {"valid_for": "2 min"}}}', []),
        ("overlays: door\ncontext: {light: {valid_for: 2 min}}\n", ["language-version"]),
        ("codra: 1\noverlays: door\ncontext: {light: {valid_for: 2 min\n", ["yaml-syntax"]),
        ("codra: 1\r\noverlays: door\r\ncontext: {light: {valid_for: 2 mins}}\r\n", ["duration"]),
        ("codra: 1\noverlays: door\nname: hall\n", ["unknown-key"]),
        ("# overlays: door\nsomething: {else: 1}\n", []),
    ],
)
def test_sites_below_a_folder_are_found_and_other_files_are_not(text: str, rules: list[str], tmp_path: Path) -> None:
    root = project(tmp_path, text)
    findings = lint_paths([root / "specs", root / "sites"], root).diagnostics

    assert [finding.rule.name for finding in findings if finding.rule.name != "no-spec"] == rules
    assert {finding.place.span.file for finding in findings if finding.rule.name != "no-spec"} <= {SITE}


@pytest.mark.parametrize("end", ["", "\n", "\n# end"])
@pytest.mark.parametrize("condition", ["'light > drak'", '"light >\\\n      drak"', ">\n      light\n      > drak\n"])
def test_places_in_a_site_are_exact_for_every_style_of_text(condition: str, end: str, tmp_path: Path) -> None:
    keys = f"perception:\n  measure:\n    observable_when:\n    - {condition}\n{end}"
    root = project(tmp_path, site_of(keys), SPEC.rstrip("\n") + end)
    (finding,) = plan_paths([root / "specs"], root, sites=[root / SITE]).diagnostics

    assert (finding.rule.name, marked(site_of(keys), finding.place)) == ("unknown-variable", "drak")


def test_a_node_declared_by_its_type_alone_gets_the_keys_of_the_site(tmp_path: Path) -> None:
    spec = SPEC + (
        "knowledge:\n"
        "  types: {robot: {attributes: {speed: {type: int, source: main_execution}}}, hall: {}}\n"
        "  nodes: {world: hall, robbie: robot}\n"
    )
    keys = "knowledge: {nodes: {robbie: {label: Robbie of hall 2, with: {speed: 2}}}}\n"
    root = project(tmp_path, site_of(keys), spec)
    loaded, _ = load_spec(root / "specs/door.yaml", root, site=root / SITE)
    assert loaded is not None

    assert [(node.name, node.type.name, node.label) for node in loaded.nodes] == [
        ("world", "hall", ""),
        ("robbie", "robot", "Robbie of hall 2"),
    ]


# Handles


def test_a_site_states_handles_with_quantities_in_si_units(tmp_path: Path) -> None:
    keys = 'resources: {camera: {call: "cameras:Camera", with: {height: 120 cm, address: 10.0.2.7}}}\n'
    spec = spec_of(tmp_path, keys)
    assert spec.site is not None
    (handle,) = spec.site.handles

    assert (handle.resource, str(handle)) == ("camera", "cameras:Camera(height=1.2, address='10.0.2.7')")


@pytest.mark.parametrize(
    ("keys", "rule", "written"),
    [
        ("camera: {call: cameras Camera}", "call", "cameras Camera"),
        ("camera: {with: {x: 1}}", "missing-key", "camera"),
        ("camera: {call: a:b, wiht: {x: 1}}", "unknown-key", "wiht"),
        ("arm: {call: a:b}", "misplaced-key", "a:b"),
        ("camera: 3", "wrong-type", "3"),
    ],
)
def test_a_handle_that_cannot_be_made_is_an_error(keys: str, rule: str, written: str, tmp_path: Path) -> None:
    text = f"resources:\n  {keys}\n"
    finding = findings_of(tmp_path, text)[0]

    assert (finding.rule.name, marked(site_of(text), finding.place)) == (rule, written)
