"""`codra sweep`: switch points with their rules, the trends of metrics, pictures, and error messages."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from typer.testing import CliRunner

from codra_dsl.cli.app import app
from codra_dsl.compiler import plan_paths
from codra_dsl.integrations.inspection.sweeps import Subject, held, subject, varied
from codra_dsl.runtime.loops.sweep import Sweep, Trend, sweep, trend

ROOT = Path(__file__).parents[2]
STORE = ROOT / "specs/store.yaml"
TRUCK = """\
codra: 1
name: truck
context:
  distance: {type: float, unit: m, range: [0, 10], source: laser, terms: {close: ramp 2 1}}
  visitors: {type: int, range: [0, 8], source: laser, terms: {many: ramp 2 4}}
  load: {type: enum, values: [empty, full], source: laser}
  tripped: {type: bool, source: laser}
agents: {laser: {}}
metrics:
  safety:
    rules:
      - if distance is close or visitors is many then low
      - if distance is not close and visitors is not many then high
actions:
  go:
    rules: [if safety is high and load is empty then high, if safety is not high or load is full then low]
  wait:
    rules: [if safety is high and load is empty then low, if safety is not high or load is full then high]
adaptation:
  course:
    choose: [go, wait]
    in: mission
    otherwise: wait
    always:
      - {if: tripped == true, then: wait}
trees:
  mission: {file: mission.xml, course: {go: Go, wait: Wait}, leaves: {}}
loops:
  driving: {analyse: [safety], adapt: [course], execute: [mission]}
"""
TREE = """\
<root BTCPP_format="4" main_tree_to_execute="Mission">
  <BehaviorTree ID="Mission">
    <Switch2 variable="{course}" case_1="go" case_2="wait">
      <SubTree ID="Go"/>
      <SubTree ID="Wait"/>
      <AlwaysSuccess/>
    </Switch2>
  </BehaviorTree>
  <BehaviorTree ID="Go"><Sleep msec="100"/></BehaviorTree>
  <BehaviorTree ID="Wait"><AlwaysSuccess/></BehaviorTree>
</root>
"""
CALM = ("--with", "visitors=0", "--with", "load=empty", "--with", "tripped=false")


@pytest.fixture
def truck(tmp_path: Path) -> Path:
    (tmp_path / "pyproject.toml").write_text("[tool.codra]\n")
    (tmp_path / "mission.xml").write_text(TREE)
    (tmp_path / "truck.yaml").write_text(TRUCK)
    return tmp_path / "truck.yaml"


def swept(spec: Path, *options: str) -> str:
    """Return the output of a sweep."""
    result = CliRunner().invoke(app, ["sweep", str(spec), *options])
    assert (result.exit_code, result.stderr) == (0, ""), result.stderr
    return result.stdout


def refused(spec: Path, *options: str) -> str:
    """Return the error message of a sweep."""
    result = CliRunner().invoke(app, ["sweep", str(spec), *options])
    assert (result.exit_code, result.stdout) == (2, "")
    return result.stderr.splitlines()[-1].removeprefix("Error: Invalid value for ")


# The store (P2)


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Subject:
    (plan,) = plan_paths([STORE], ROOT).plans
    return subject(plan, tmp_path_factory.mktemp("store"))


def of_store(store: Subject, vary: str, steps: int, **known: str) -> Sweep:
    """Return a sweep of the store in which all inputs are known."""
    usual = {
        "bumped": "false",
        "person_distance": "6",
        "picking_up": "true",
        "order_open": "true",
        "loaded": "false",
        "battery_level": "80",
        "battery_drain": "0.5",
        "charging": "false",
        "crowding": "1",
        "container_load": "empty",
        "people_at_container": "0",
    }
    variable, values = varied(store, vary, steps)
    given = held(store, [f"{name}={value}" for name, value in (usual | known).items()])
    arguments = (store.model, store.course, given, variable.name, values)
    return sweep(*arguments, unit=variable.type.unit or "", variables=store.variables)


def assert_explained(sweep_result: Sweep) -> None:
    """Assert that each switch has a rule of the spec, printed with its place."""
    printed = str(sweep_result)
    for switch in sweep_result.switches:
        assert switch.rules
        for rule in switch.rules:
            assert rule.place.startswith("specs/store.yaml:")
            assert f"  {rule.text}: " in printed
            assert abs(rule.before - rule.after) > 1e-9


@pytest.mark.parametrize("load", ["empty", "loading", "full"])
@pytest.mark.parametrize("loaded", ["false", "true"])
@pytest.mark.parametrize(("picking_up", "way"), [("false", Trend.CONSTANT), ("true", Trend.RISES)])
def test_in_the_store_safety_never_falls_as_people_go_away(
    store: Subject, load: str, loaded: str, picking_up: str, way: Trend
) -> None:
    known = {"container_load": load, "loaded": loaded, "picking_up": picking_up}
    result = of_store(store, "person_distance=0.3..6", 57, **known)

    assert result.trends["safety"] is way
    assert_explained(result)


def test_in_the_store_safety_never_rises_as_more_people_come_to_the_container(store: Subject) -> None:
    result = of_store(store, "people_at_container=0,1,2,3", 1)

    assert result.trends["safety"] is Trend.FALLS
    assert [row.action for row in result.rows] == ["pick", "start", "start", "start"]
    assert_explained(result)


def test_in_the_store_the_truck_turns_back_from_its_pick_up_where_people_are_too_close(store: Subject) -> None:
    (switch,) = of_store(store, "person_distance=0.3..6", 57).switches

    assert (switch.before, switch.after) == ("start", "pick")
    assert 2.0 < float(switch.low) < float(switch.high) < 2.1


@pytest.mark.parametrize("loaded", ["false", "true"])
@pytest.mark.parametrize("distance", ["0.5", "2", "6"])
def test_in_the_store_an_empty_battery_sends_the_truck_to_its_dock(store: Subject, loaded: str, distance: str) -> None:
    result = of_store(store, "battery_level", 50, loaded=loaded, person_distance=distance)

    assert result.trends["power_autonomy"] is Trend.RISES
    assert (result.rows[0].action, result.rows[0].rule) == ("dock", "battery_level < 10 percent")
    assert result.switches[0].before == "dock"
    assert_explained(result)


def test_with_few_values_too_a_hard_rule_explains_only_a_switch_at_its_limit(store: Subject) -> None:
    few, many = (
        of_store(store, "battery_level", steps, loaded="false", person_distance="6").switches[0] for steps in (3, 101)
    )

    assert float(few.high) > 10.0
    assert few.high == pytest.approx(many.high)
    assert [rule.text for rule in few.rules] == [rule.text for rule in many.rules]


@pytest.mark.parametrize("order_open", ["false", "true"])
def test_in_the_store_a_full_container_is_delivered(store: Subject, order_open: str) -> None:
    result = of_store(store, "loaded", 1, container_load="full", order_open=order_open)

    assert [(row.value, row.derived["full_on_fork"]) for row in result.rows] == [(False, False), (True, True)]
    assert result.rows[-1].action == "deliver"
    assert result.trends["safety"] is Trend.CONSTANT
    assert_explained(result)


# Printed text


def test_a_sweep_is_a_table_with_its_switches_and_the_trends_of_the_metrics(truck: Path) -> None:
    assert (
        swept(truck, "--vary", "distance=0..4", "--steps", "4", *CALM)
        == """\
with visitors = 0, load = empty, tripped = false
distance (m)  safety      go    wait  action
           0  0.1857  0.1857  0.8143    wait
           1  0.1857  0.1857  0.8143    wait
           2  0.8143  0.8143  0.1857      go
           3  0.8143  0.8143  0.1857      go
           4  0.8143  0.8143  0.1857      go
wait -> go at 1.769 m:
  if safety is high and load is empty then weight_of_go is high: 0 -> 1  [truck.yaml:16]
  if distance is close or visitors is many then safety is low: 1 -> 0  [truck.yaml:12]
safety is monotone: it never falls
"""
    )


def test_trends_refer_to_a_rising_input_in_every_order_of_the_sweep(truck: Path) -> None:
    for values in ("0..4", "4..0", "2,0,4,1,3"):
        printed = swept(truck, "--vary", f"distance={values}", "--steps", "4", *CALM)
        assert printed.endswith("safety is monotone: it never falls\n")


def test_a_hard_rule_explains_a_switch(truck: Path) -> None:
    assert (
        swept(truck, "--vary", "tripped", "--with", "distance=300 cm", *CALM[:4])
        == """\
with distance = 3, visitors = 0, load = empty
tripped  safety      go    wait  action
  false  0.8143  0.8143  0.1857      go
   true  0.8143  0.8143  0.1857    wait
go -> wait between false and true:
  tripped == true: 0 -> 1  [truck.yaml:25]
safety is constant
"""
    )


POSES = """\
knowledge:
  nodes: {world: world, truck: truck, ramp: ramp}
  edges:
    truck_pose: {label: RT, from: world, to: truck, source: laser, valid_for: 2 s}
    ramp_pose: {label: RT, from: world, to: ramp, static: true}
"""


def test_a_comparison_with_poses_is_an_input_by_its_own_text(truck: Path) -> None:
    near = "distance(truck, ramp) <= 1 m"
    truck.write_text(TRUCK.replace("tripped == true", f'"{near}"') + POSES)
    printed = swept(truck, "--vary", near, "--with", "visitors=0", "--with", "load=empty", "--with", "distance=8")
    assert "go -> wait between false and true" in printed
    printed = swept(truck, "--vary", "load", "--with", f"{near}=true", "--with", "visitors=0", "--with", "distance=8")
    assert f"{near} = true" in printed.splitlines()[0]


GUESTS = """\
  guests: {type: int, range: [0, 9], derived: visitors + 1 if tripped else visitors, terms: {many: ramp 2 4}}
"""


@pytest.fixture
def guests(truck: Path) -> Path:
    """The truck whose rules read a derived variable in place of one of its inputs."""
    truck.write_text(TRUCK.replace("visitors is", "guests is").replace("agents:", f"{GUESTS}agents:"))
    return truck


def test_a_derived_variable_follows_from_the_inputs_that_are_varied_and_given(guests: Path) -> None:
    assert (
        swept(
            guests, "--vary", "visitors=0..4", "--with", "distance=9", "--with", "load=empty", "--with", "tripped=false"
        )
        == """\
with distance = 9, load = empty, tripped = false
visitors  guests  safety      go    wait  action
       0       0  0.8143  0.8143  0.1857      go
       1       1  0.8143  0.8143  0.1857      go
       2       2  0.8143  0.8143  0.1857      go
       3       3     0.5  0.1857  0.8143    wait
       4       4  0.1857  0.1857  0.8143    wait
go -> wait between 2 and 3:
  if safety is high and load is empty then weight_of_go is high: 1 -> 3.7e-16  [truck.yaml:17]
  if distance is close or guests is many then safety is low: 0 -> 0.5  [truck.yaml:13]
safety is monotone: it never rises
"""
    )
    assert "       1  unknown  0.1836" in swept(guests, "--vary", "visitors=1,2", "--with", "distance=9")


def test_a_derived_variable_can_be_given_in_place_of_its_inputs_but_not_together_with_them(guests: Path) -> None:
    result = json.loads(swept(guests, "--vary", "guests=0,8", "--with", "distance=9", *CALM[2:4], "--format", "json"))
    assert [(row["value"], row["action"], row["derived"]) for row in result["rows"]] == [(0, "go", {}), (8, "wait", {})]
    message = "'guests' follows from 'visitors': give a value for only one of them"
    assert refused(guests, "--vary", "guests", "--with", "visitors=2") == f"--vary: {message}"
    assert refused(guests, "--vary", "load", "--with", "guests=1", "--with", "visitors=2") == f"--with: {message}"
    assert "guests    0..9         terms many; follows from tripped, visitors\n" in swept(guests)


def test_a_switch_over_whole_numbers_lies_between_two_of_them(truck: Path) -> None:
    printed = swept(truck, "--vary", "visitors=0,8", "--with", "distance=9", *CALM[2:])
    assert "go -> wait between 2 and 3:\n" in printed


def test_an_input_without_a_value_is_unknown(truck: Path) -> None:
    assert (
        swept(truck, "--vary", "visitors=0,4", "--with", "load=empty", "--with", "tripped=unknown")
        == """\
with load = empty
unknown: distance, tripped
visitors  safety      go    wait  action
       0  0.1845  0.1857  0.8143    wait
       4  0.1857  0.1857  0.8143    wait
safety is monotone: it never falls
"""
    )


def test_without_vary_the_inputs_are_listed(truck: Path) -> None:
    assert (
        swept(truck)
        == """\
distance  0..10 m      terms close
visitors  0..8         terms many
load      empty, full
tripped   false, true
"""
    )


def test_lists_and_integers_are_swept_as_they_are(truck: Path) -> None:
    result = json.loads(swept(truck, "--vary", "visitors", "--with", "distance=9", *CALM[2:], "--format", "json"))
    given = json.loads(swept(truck, "--vary", "visitors=8, 0", "--with", "distance=9", *CALM[2:], "--format", "json"))

    assert [row["value"] for row in result["rows"]] == list(range(9))
    assert result["trends"] == {"safety": "falls"}
    assert result["known"] == {"distance": 9.0, "load": "empty", "tripped": False}
    ((switch),) = result["switches"]
    assert (switch["before"], switch["after"], switch["rules"][0]["place"]) == ("go", "wait", "truck.yaml:16")
    assert [row["value"] for row in given["rows"]] == [8, 0]
    assert given["trends"] == {"safety": "falls"}


def test_the_inputs_are_listed_as_json_too(truck: Path) -> None:
    inputs_object = json.loads(swept(truck, "--format", "json"))

    assert inputs_object["inputs"][0] == {
        "variable": "distance",
        "type": "float",
        "unit": "m",
        "range": [0.0, 10.0],
        "members": [],
        "terms": ["close"],
        "follows_from": [],
    }


def test_a_spec_without_a_course_has_its_metrics_swept(tmp_path: Path) -> None:
    text = (
        TRUCK.partition("actions:")[0]
        + """\
adaptation:
  speed: {set: max_speed, value: 0.3 m/s if safety < 0.6 else 1.2 m/s}
loops:
  driving: {analyse: [safety], adapt: [speed]}
"""
    )
    speed = "  max_speed: {type: float, unit: m/s, range: [0, 1.5], source: adaptation, valid_for: forever}\nagents:"
    lines = [line for line in text.replace("agents:", speed).splitlines() if not line.startswith(("  load", "  trip"))]
    (tmp_path / "truck.yaml").write_text("\n".join(lines) + "\n")

    assert (
        swept(tmp_path / "truck.yaml", "--vary", "distance=0,9", "--with", "visitors=0")
        == """\
with visitors = 0
distance (m)  safety
           0  0.1857
           9  0.8143
safety is monotone: it never falls
"""
    )


@pytest.mark.parametrize(
    ("numbers", "way"),
    [
        ([0.1, 0.1, 0.2], Trend.RISES),
        ([0.2, 0.1, 0.1], Trend.FALLS),
        ([0.1, 0.1 + 1e-12], Trend.CONSTANT),
        ([0.1, 0.2, 0.1], Trend.TURNS),
        ([0.1, None, 0.2], Trend.UNKNOWN),
        ([0.3], Trend.CONSTANT),
    ],
)
def test_the_trend_of_numbers(numbers: list[float | None], way: Trend) -> None:
    assert trend(numbers) is way
    assert way.is_monotone is (way not in (Trend.TURNS, Trend.UNKNOWN))


# Pictures


def words(svg: str) -> Iterator[str]:
    """Yield the texts of a picture."""
    for text_element in ET.fromstring(svg).iter("{http://www.w3.org/2000/svg}text"):
        yield "".join(text_element.itertext())


@pytest.mark.parametrize(
    ("options", "shown"),
    [
        ((), {"distance in m", "close", "visitors", "many"}),
        (
            ("--vary", "distance", *CALM),
            {"distance in m", "terms", "close", "metrics", "safety", "weights", "go", "wait"},
        ),
        (("--vary", "load", "--with", "distance=9", *CALM[:2]), {"load", "empty", "full", "metrics", "weights"}),
        (
            ("--vary", "distance", "--vary", "load", *CALM[:2]),
            {"distance in m", "load", "empty", "safety", "weight of go", "course", "wait"},
        ),
    ],
)
def test_a_picture_names_what_it_shows_and_is_reproducible(
    truck: Path, options: tuple[str, ...], shown: Mapping[str, str]
) -> None:
    svg = swept(truck, *options, "--steps", "6", "--format", "svg")

    assert set(shown) <= set(words(svg))
    assert swept(truck, *options, "--steps", "6", "--format", "svg") == svg


def test_the_ending_of_a_file_chooses_the_format(truck: Path, tmp_path: Path) -> None:
    assert swept(truck, "--output", str(tmp_path / "terms.svg")) == ""
    assert "close" in set(words((tmp_path / "terms.svg").read_text("utf-8")))
    assert refused(truck, "--output", str(tmp_path / "terms.png")) == (
        "--output: no sweep format has the ending '.png': use --format, or one of .txt, .json, .svg"
    )


# Errors


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--vary", "distanse"), "--vary: no rule of 'truck' reads 'distanse': did you mean 'distance'?"),
        (("--vary", "sun"), "--vary: no rule of 'truck' reads 'sun': rules read distance, visitors, load, tripped"),
        (("--vary", "distance=1..12"), "--vary: 'distance' is from 0 to 10 m, not 12"),
        (("--vary", "distance=1 s..2 s"), "--vary: 'distance' is a number in m, not '1 s'"),
        (("--vary", "distance=near"), "--vary: 'near' is not a number: write distance=1.5, or FROM..TO to vary it"),
        (("--vary", "distance=1.."), "--vary: '' is not a number: write distance=1.5, or FROM..TO to vary it"),
        (("--vary", "visitors=1,1.5"), "--vary: 'visitors' is a whole number, not 1.5"),
        (("--vary", "visitors=2 m"), "--vary: 'visitors' is a number without a unit, not '2 m'"),
        (("--vary", "load=ful"), "--vary: 'load' is empty or full, not 'ful': did you mean 'full'?"),
        (("--vary", "load", "--with", "load=full"), "--vary: 'load' is varied: give it only once, and not with --with"),
        (("--vary", "load", "--with", "distance"), "--with: 'distance' has no value: write distance=VALUE"),
        (("--vary", "load", "--with", "tripped=yes"), "--with: 'tripped' is false or true, not 'yes'"),
        (
            ("--vary", "load", "--vary", "distance"),
            "--vary: two inputs can only be drawn: add --format svg, or vary only one",
        ),
        (("--vary", "load", "--vary", "a", "--vary", "b"), "--vary: at most 2 inputs can be varied at once"),
        (
            ("--vary", "load", "--vary", "load", "--format", "svg"),
            "--vary: 'load' is varied: give it only once, and not with --with",
        ),
        (("--course", "cuorse"), "--course: 'truck' has no course 'cuorse': did you mean 'course'?"),
    ],
)
def test_an_error_is_reported_with_help(truck: Path, options: tuple[str, ...], message: str) -> None:
    assert refused(truck, *options) == message


def test_a_spec_without_fuzzy_rules_cannot_be_swept(tmp_path: Path) -> None:
    (tmp_path / "door.yaml").write_text(
        "codra: 1\nname: door\ncontext:\n  door_open: {type: bool, source: main_execution}\n"
    )

    assert refused(tmp_path / "door.yaml") == (
        "SPEC: 'door' has neither metrics nor actions: a sweep has nothing to show"
    )
