"""Loops in generated code: the modules of the store's spec, and their behaviour."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.compiler import compile_paths
from codra_dsl.integrations.inspection.loading import load_emitted
from codra_dsl.runtime import Journal, SimClock, UnknownNameError
from codra_dsl.runtime.behavior_trees import Action, Ports, Result, Robot
from codra_dsl.runtime.loops.loop import Mape
from codra_dsl.runtime.loops.planning import Planning
from codra_dsl.runtime.replay import replay
from generated import store
from generated.store import Store, action_engine, metric_engine
from generated.store.mape import MAPE
from tests.runtime.journal.journals import read

ROOT = Path(__file__).parents[3]
CALM = {
    "bumped": 0.0,
    "person_distance": 6.0,
    "picking_up": 0.0,
    "order_open": 1.0,
    "loaded": 0.0,
    "battery_level": 80.0,
    "battery_drain": 0.5,
    "charging": 0.0,
    "crowding": 0.0,
    "container_load": 0.0,
    "full_on_fork": 0.0,
    "people_at_container": 0.0,
}
"""An order is open, the fork is empty, and no person is near."""


def metrics(**changed_inputs: float) -> dict[str, float]:
    inputs = CALM | changed_inputs
    inference = metric_engine.infer(*(inputs[name] for name in metric_engine.INPUTS))
    return dict(zip(metric_engine.OUTPUTS, inference.values, strict=True))


def weights(**changed_inputs: float) -> dict[str, float]:
    inputs = CALM | changed_inputs | metrics(**changed_inputs)
    inference = action_engine.infer(*(inputs[name] for name in action_engine.INPUTS))
    names = (name.removeprefix("weight_of_") for name in action_engine.OUTPUTS)
    return dict(zip(names, inference.values, strict=True))


def heaviest_action(**changed_inputs: float) -> str:
    action_weights = weights(**changed_inputs)
    return max(action_weights, key=lambda name: action_weights[name])


# P2, section 6


def test_a_full_container_on_the_fork_goes_to_the_general_delivery_pose() -> None:
    assert heaviest_action(loaded=1.0, container_load=1.0) == "pick"
    assert heaviest_action(loaded=1.0, container_load=2.0, full_on_fork=1.0) == "deliver"


def test_a_person_close_to_a_robot_that_picks_up_halves_safety_and_sends_it_to_the_start() -> None:
    assert metrics(picking_up=1.0, person_distance=1.5)["safety"] == pytest.approx(0.5)
    assert heaviest_action(picking_up=1.0, person_distance=1.5, crowding=1.0) == "start"


def test_a_person_at_an_empty_container_halves_safety_and_a_load_or_more_people_lower_it_further() -> None:
    at_empty, at_loading, at_full = (
        metrics(picking_up=1.0, people_at_container=1.0, container_load=load)["safety"] for load in (0.0, 1.0, 2.0)
    )
    among_several = [metrics(picking_up=1.0, people_at_container=count)["safety"] for count in (2.0, 3.0, 20.0)]

    assert at_empty == pytest.approx(0.5)
    assert at_empty > at_loading == at_full > among_several[0]
    assert among_several == [pytest.approx(0.1857, abs=1e-4)] * 3
    assert heaviest_action(picking_up=1.0, people_at_container=1.0, crowding=1.0) == "start"
    assert heaviest_action(picking_up=1.0, people_at_container=1.0, container_load=2.0, crowding=1.0) == "start"


def test_one_person_who_passes_does_not_end_a_pick_up_but_several_do() -> None:
    assert heaviest_action(picking_up=1.0, people_at_container=1.0, crowding=0.4) == "pick"
    assert heaviest_action(picking_up=1.0, people_at_container=1.0, container_load=2.0, crowding=0.4) == "pick"
    assert heaviest_action(picking_up=1.0, person_distance=1.0, crowding=0.4) == "pick"
    assert heaviest_action(picking_up=1.0, people_at_container=2.0, crowding=0.0) == "start"


def test_people_at_a_container_do_not_stop_a_robot_that_drives() -> None:
    assert heaviest_action(people_at_container=3.0) == "pick"


def test_people_in_the_corridors_do_not_stop_a_robot_that_drives() -> None:
    assert heaviest_action(person_distance=1.0) == "pick"


def test_a_battery_that_runs_low_sends_it_to_charge() -> None:
    assert heaviest_action(battery_level=12.0) == "dock"


def test_a_battery_that_drains_fast_sends_it_to_charge_earlier() -> None:
    """P2, section 5.2: a mission is aborted if the power autonomy decreases quickly."""
    assert [heaviest_action(battery_level=30.0, battery_drain=drain) for drain in (4.0, 8.0)] == ["pick", "dock"]
    assert heaviest_action(battery_level=50.0, battery_drain=8.0) == "pick"


def test_a_truck_that_charges_stays_until_the_battery_is_charged() -> None:
    assert [heaviest_action(battery_level=level, charging=1.0) for level in (12.0, 60.0, 90.0)] == [
        *("dock", "dock", "pick"),
    ]


def test_safety_never_falls_when_a_person_goes_away() -> None:
    values = [metrics(picking_up=1.0, person_distance=step / 100.0)["safety"] for step in range(30, 600, 5)]

    assert values == sorted(values)


@given(
    **{name: st.sampled_from((0.0, 1.0)) for name in ("bumped", "picking_up", "order_open", "loaded")},
    person_distance=st.floats(0.0, 10.0),
    battery_level=st.floats(0.0, 100.0),
    battery_drain=st.floats(0.0, 20.0),
    charging=st.sampled_from((0.0, 1.0)),
    crowding=st.floats(0.0, 1.0),
    container_load=st.sampled_from((0.0, 1.0, 2.0)),
    full_on_fork=st.sampled_from((0.0, 1.0)),
    people_at_container=st.integers(0, 20).map(float),
)
def test_some_rule_acts_in_every_case(**seen: float) -> None:
    values = metrics(**seen) | weights(**seen)

    assert all(0.0 <= value <= 1.0 for value in values.values()), values


# Generated code


def test_the_same_spec_compiles_to_the_same_bytes_and_one_without_loops_has_no_module_of_them() -> None:
    first, second = (compile_paths([ROOT / "specs"], ROOT).files for _ in range(2))

    assert first == second
    assert "store/mape.py" in first
    assert not {path for path in first if path.startswith(("lab/", "kitchen/")) and "mape" in path}


def test_members_that_are_not_names_in_python_are_compiled(tmp_path: Path) -> None:
    """The members of an enum are texts, such as `on-hold`."""
    text = (ROOT / "tests/cases/invalid/loops-words.yaml").read_text("utf-8")
    (tmp_path / "pyproject.toml").write_text("[tool.codra]\n")
    for old, new in (("any, ", ""), ("load is any", "load is full"), ("very:", "near:")):
        text = text.replace(old, new)
    (tmp_path / "truck.yaml").write_text(text)

    files = compile_paths([tmp_path / "truck.yaml"], tmp_path).files

    assert "on-hold" in files["truck/metric_engine.py"]
    for path, content in files.items():
        if path.endswith(".py"):
            compile(content, path, "exec")


def test_stages_name_the_inputs_outputs_and_rules_of_their_engines() -> None:
    for stage, engine in ((MAPE.metrics, metric_engine), (MAPE.actions, action_engine)):
        assert stage is not None
        assert tuple(stage_variable.variable for stage_variable in stage.inputs) == engine.INPUTS
        assert tuple(stage_variable.range for stage_variable in stage.inputs) == engine.RANGES
        assert tuple(stage_variable.variable for stage_variable in stage.outputs) == engine.OUTPUTS
        assert tuple(rule.text for rule in stage.rules) == engine.RULES


def test_every_action_has_a_branch_and_every_rate_a_loop() -> None:
    (mission, _) = MAPE.trees
    (course,) = MAPE.courses

    assert tuple(mission.branches) == course.choose
    assert [loop.rates for loop in MAPE.loops] == [("battery_drain", "crowding"), ()]
    assert MAPE.rates[0].factor == pytest.approx(-60.0)


def test_files_beside_the_code_have_all_rules_conditions_and_edges_of_loops() -> None:
    files = compile_paths([ROOT / "specs"], ROOT).files
    sources, graph = json.loads(files["store/sources.json"]), json.loads(files["store/graph.json"])
    edges = {(edge["source"], edge["kind"], edge["target"]) for edge in graph["edges"]}

    assert sources["store/metric/safety/rules/0"]["file"] == "specs/store.yaml"
    assert {"store/action/dock/rules/1", "store/adaptation/course/always/0", "store/tree/mission"} <= sources.keys()
    assert {
        ("store/metric/safety", "reads", "store/context/person_distance"),
        ("store/action/dock", "reads", "store/metric/power_autonomy"),
        ("store/adaptation/course", "weighs", "store/action/dock"),
        ("store/adaptation/course", "switches", "store/tree/mission"),
        ("store/adaptation/speed", "sets", "store/context/max_speed"),
        ("store/tree/mission", "requests", "store/task/navigating"),
        ("store/loop/mission", "executes", "store/tree/mission"),
        ("store/agent/analysis", "owns", "store/metric/safety"),
    } <= edges
    assert "store/context/safety" not in {node["id"] for node in graph["nodes"]}, "the metric itself is in the graph"
    assert {end for source, _, target in edges for end in (source, target)} <= {node["id"] for node in graph["nodes"]}


def test_the_graph_shows_the_bools_of_shares_and_held_bools_and_the_actions_of_filtered_weights() -> None:
    case = ROOT / "tests/cases/valid/loops-everything"
    graph = json.loads(compile_paths([case / "spec.yaml"], case).files["loops_everything/graph.json"])
    edges = {(edge["source"], edge["kind"], edge["target"]) for edge in graph["edges"]}

    assert {
        ("loops_everything/context/burden", "reads", "loops_everything/context/lifted"),
        ("loops_everything/context/stuck", "reads", "loops_everything/context/lifted"),
        ("loops_everything/context/filtered_weight_of_wait", "reads", "loops_everything/action/wait"),
    } <= edges


def test_the_file_of_a_tree_is_an_input_of_the_run_that_names_it() -> None:
    planned = compile_paths([ROOT / "specs"], ROOT).planned

    assert {"specs/trees/mission.xml", "specs/trees/pick_up.xml"} <= set(planned.modules)


# Behaviour


class Busy(Action):
    """An action that runs until it is halted."""

    def start(self, ports: Ports) -> Result:  # noqa: ARG002
        return Result.RUNNING

    def go_on(self, ports: Ports) -> Result:  # noqa: ARG002
        return Result.RUNNING

    def halt(self, ports: Ports) -> None:
        """Nothing needs to be undone."""


@contextmanager
def running() -> Iterator[tuple[Store, SimClock, Mape]]:
    clock = SimClock()
    robot = Robot()
    for leaf in (
        "TakeOrder",
        "SetOrderAside",
        "ResumeOrders",
        "CompleteOrder",
        "RedirectOrder",
        "GiveOrderUp",
        "CloseOrder",
    ):
        robot.can(leaf, Busy)
    for leaf in ("IsLoaded", "MoveTo", "PickUp", "LowerFork", "Inform", "IsRequested"):
        robot.can(leaf, Busy)
    for leaf in ("Report", "DetectContainer", "Rotate", "CheckWheels", "RaiseFork"):
        robot.can(leaf, Busy)
    with store.start(clock=clock, resources={}) as codra, store.loops(codra, clock=clock, robot=robot) as loops:
        yield codra, clock, loops


def test_the_loops_run_and_write_metrics_weights_course_and_speed() -> None:
    with running() as (codra, clock, loops):
        names = ("localisation", "navigation", "person_detection", "lasers", "fork", "picker_page")
        agents = {name: codra.agent(name) for name in names}
        planners = {name: codra.agent(name) for name in ("mission", "picking")}
        set_context = partial(_set_context, agents | planners)
        set_context(person_distance=6.0)
        for _ in range(40):
            set_context(person_distance=6.0)
            clock.sleep(0.5)
        calm_values = codra.get("course").value, codra.get("max_speed").value
        planners["picking"].set("picking_up", True)
        for _ in range(60):
            set_context(person_distance=1.2)
            clock.sleep(0.5)

        assert calm_values == ("pick", 1.2)
        assert codra.get("safety").value == pytest.approx(0.5)
        assert (codra.get("course").value, codra.get("max_speed").value) == ("start", 0.3)
        assert loops.course_state("course").state.action == "start"


def _set_context(agents: dict[str, object], *, person_distance: float) -> None:
    values_by_agent = {
        "localisation": {"pose_spread": 0.03},
        "navigation": {"battery_level": 80.0, "bumped": False, "charging": False},
        "person_detection": {"person_distance": person_distance},
        "lasers": {"strange_gap": person_distance - 0.7},
        "fork": {"loaded": False},
        "picker_page": {"container_load": "empty"},
        "mission": {"order_open": True},
    }
    for agent, values in values_by_agent.items():
        for name, value in values.items():
            agents[agent].set(name, value)  # type: ignore[attr-defined]


# Loops and observers

FAN = """\
codra: 1
name: fan
context:
  heat: {type: float, range: [0, 40], valid_for: 10 s, terms: {hot: ramp 20 30}}
  plugged: {type: bool, source: main_execution}
  rpm: {type: float, range: [0, 3000], source: adaptation, valid_for: forever}
perception:
  feel:
    call: tests.generation.emit.test_emit_loops:feel
    returns: {celsius: {type: float, range: [0, 40]}}
    identifies: {heat: celsius}
skills:
  mend: {preview: [plugged]}
metrics:
  comfort: {rules: [if heat is hot then low, if heat is not hot then high]}
adaptation:
  fan: {set: rpm, value: 3000 if comfort < 0.5 else 300}
loops:
  fan: {analyse: [comfort], adapt: [fan]}
"""


def feel(**_: object) -> dict[str, float]:
    return {"celsius": 20.0}


@pytest.fixture
def fan(tmp_path: Path) -> Any:
    """The package of a spec without knowledge. Its loop reads a variable that an observer identifies."""
    (tmp_path / "pyproject.toml").write_text("[tool.codra]\n")
    (tmp_path / "fan.yaml").write_text(FAN)
    compiled = compile_paths([tmp_path / "fan.yaml"], tmp_path)
    assert compiled.planned.diagnostics == ()
    return load_emitted(compiled.files, "fan", tmp_path / "made")


def test_observers_identify_the_inputs_of_a_loop_while_it_runs(fan: Any, tmp_path: Path) -> None:
    clock = SimClock()
    with fan.start(clock=clock, resources={}, record=Journal(tmp_path / "run.mcap")) as codra:
        with fan.loops(codra, clock=clock):
            clock.sleep(3.0)
            assert (codra.get("heat").value, codra.get("rpm").value) == (20.0, 300.0)
            assert codra.declared() == {"heat"}
        assert (codra.declared(), codra.running()) == (frozenset(), frozenset())
    head, events = read(tmp_path / "run.mcap")
    assert replay(head, events, fan.MODEL, fan.Fan, None).difference is None


def test_a_loop_that_is_stopped_while_it_starts_in_another_thread_stops_declaring(fan: Any) -> None:
    is_starting, may_go_on = threading.Event(), threading.Event()

    class Slow(Planning):
        def resume(self) -> None:
            is_starting.set()
            assert may_go_on.wait(10.0)

    clock = SimClock()
    with fan.start(clock=clock, resources={}) as codra:
        mape = Mape(codra, import_module(f"{fan.__name__}.mape").MAPE, clock=clock, planner=Slow)
        starting = threading.Thread(target=mape.start)
        starting.start()
        assert is_starting.wait(10.0)
        mape.stop()
        may_go_on.set()
        starting.join(10.0)
        assert (mape.loop("fan").is_running, codra.declared()) == (False, frozenset())
        mape.start()
        assert codra.declared() == {"heat"}
        mape.close()
        assert codra.declared() == frozenset()


def test_an_adaptation_is_explained_without_knowledge_and_a_misspelt_name_is_corrected(fan: Any) -> None:
    clock = SimClock()
    with fan.start(clock=clock, resources={}) as codra, fan.loops(codra, clock=clock):
        clock.sleep(1.0)
        assert "fan is 300 at 1 s" in str(codra.why("fan"))
        with pytest.raises(UnknownNameError, match=r"the spec has no variable 'haet': did you mean 'heat'\?"):
            codra.why("haet")


GATE = """\
codra: 1
name: gate
context:
  gap: {type: float, unit: m, range: [0, 10], source: guard, valid_for: forever}
  blocked: {type: bool, derived: gap < 1 m}
  blocked_long: {type: bool, held: blocked, for: 5 s, valid_for: 1 min}
  horn: {type: bool, source: adaptation, valid_for: forever}
agents: {guard: {}}
adaptation:
  warn: {set: horn, value: blocked_long, otherwise: false}
loops:
  watch: {adapt: [warn]}
"""


def test_a_held_bool_of_a_spec_is_true_when_its_time_is_over(tmp_path: Path) -> None:
    (tmp_path / "pyproject.toml").write_text("[tool.codra]\n")
    (tmp_path / "gate.yaml").write_text(GATE)
    compiled = compile_paths([tmp_path / "gate.yaml"], tmp_path)
    assert compiled.planned.diagnostics == ()
    gate = load_emitted(compiled.files, "gate", tmp_path / "made")
    clock = SimClock()
    with gate.start(clock=clock, resources={}) as codra, gate.loops(codra, clock=clock):
        codra.agent("guard").set("gap", 0.5)
        clock.sleep(4.9)
        assert (codra.get("blocked_long").known, codra.get("horn").value) == (False, False)
        clock.sleep(0.1)
        assert (codra.get("blocked_long").value, codra.get("horn").value) == (True, True)
        codra.agent("guard").set("gap", 2.0)
        clock.sleep(0.1)
        assert (codra.get("blocked_long").value, codra.get("horn").value) == (False, False)
        codra.agent("guard").set("gap", 0.5)
        clock.sleep(66.0)
        assert (str(codra.get("blocked_long").reason), codra.get("horn").value) == ("stale", False)
