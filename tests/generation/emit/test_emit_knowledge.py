"""Knowledge and agents as Python: the runtime gets exactly what a spec declares, and no text of a spec becomes code."""

from __future__ import annotations

import ast
import dataclasses
import json
import math
import subprocess
import sys
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.compiler import plan_text
from codra_dsl.generation.build_plan import BuildPlan
from codra_dsl.generation.emit import emit, package_text
from codra_dsl.generation.emit.knowledge import KNOWLEDGE_DEFAULTS
from codra_dsl.integrations.inspection.loading import load_start
from codra_dsl.language.diagnostics import has_errors
from codra_dsl.language.project import GENERATED_API
from codra_dsl.runtime import ContextManager, NotASourceError, SimClock
from codra_dsl.runtime.geometry import Motion, Pose
from codra_dsl.runtime.knowledge import Knowledge, KnowledgeModel, Stage, declarations
from codra_dsl.runtime.knowledge.declarations import absent, backward, by, distance, in_view, path, ranked, some
from codra_dsl.runtime.values.conditions import value
from tests.generation.emit.test_emit import HOSTILE
from tests.generation.emit.test_typed_access import PACKAGES, errors_in

ROOT = Path(__file__).parents[3]
SPEC = ROOT / "tests/cases/valid/knowledge.yaml"
EVERYTHING = ROOT / "tests/cases/valid/knowledge-everything.yaml"
TWO_FORKS = ROOT / "tests/cases/valid/knowledge-in-templates.yaml"


def planned(text: str) -> BuildPlan:
    done = plan_text(text, "specs/spec.yaml", ROOT)
    assert not has_errors(done.diagnostics), done.diagnostics
    return done.plans[0]


@cache
def files(spec: Path) -> dict[str, str]:
    return dict(emit(planned(spec.read_text("utf-8"))))


def module(text: str) -> ModuleType:
    made = ModuleType("knowledge")
    exec(compile(text, "knowledge.py", "exec"), made.__dict__)
    return made


def model(spec: Path = SPEC) -> KnowledgeModel:
    (text,) = (text for name, text in files(spec).items() if name.endswith("/knowledge.py"))
    made = module(text).KNOWLEDGE
    assert isinstance(made, KnowledgeModel)
    return made


def model_of(text: str) -> KnowledgeModel:
    texts_by_path = emit(planned(text))
    knowledge_model = module(
        next(texts_by_path[name] for name in texts_by_path if name.endswith("/knowledge.py"))
    ).KNOWLEDGE
    assert isinstance(knowledge_model, KnowledgeModel)
    return knowledge_model


def started(folder: Path, spec: Path = SPEC) -> ContextManager[Any, Any]:
    (package,) = {name.split("/")[0] for name in files(spec)}
    manager = load_start(files(spec), package, folder)(clock=SimClock(), resources={})
    assert isinstance(manager, ContextManager)
    return manager


def find_model(models: tuple[Any, ...], name: str) -> Any:
    return next(model for model in models if model.name == name)


# Declarations


def test_writers_are_in_the_order_of_their_priorities() -> None:
    container = find_model(model().node_types, "roll_container")

    assert container.sources == by("container_detection")
    assert [(attribute.name, attribute.sources) for attribute in container.attributes] == [
        ("full", by("picker_page")),
        ("weight", ranked("fork", "container_detection")),
    ]


def test_writers_with_equal_priorities_keep_them() -> None:
    made = model_of(
        "codra: 1\nname: three\nknowledge: {types: {box: {source: {a: 5, b: 5, c: 1}}}}\n"
        "agents: {a: {}, b: {}, c: {}}\n"
    )

    assert [(writer.agent, writer.priority) for writer in made.node_types[0].sources] == [("a", 5), ("b", 5), ("c", 1)]


def test_context_variables_are_attributes_of_their_nodes() -> None:
    nodes = model().nodes
    (level,) = find_model(nodes, "battery").attributes

    assert (level.name, level.sources, level.valid_for_s) == ("battery_level", by("navigation"), 60.0)
    robot_model = find_model(nodes, "robot")
    assert [attribute.name for attribute in robot_model.attributes] == [
        "person_distance",
        "container_load",
    ]


def test_a_context_variable_of_no_node_is_of_the_context() -> None:
    made = model_of(
        "codra: 1\nname: lamp\ncontext: {lit: {type: bool, source: lamp}}\nagents: {lamp: {wakes: not lit}}\n"
        "knowledge: {nodes: {room: room}}\n"
    )

    assert [attribute.name for attribute in find_model(made.nodes, "context").attributes] == ["lit"]
    assert repr(made.agents[0].wakes[0]) == repr(~value("context.lit"))
    assert Knowledge(made, clock=SimClock()).get("context", "lit").known is False


def test_a_context_variable_of_a_task_is_an_attribute_of_its_node() -> None:
    made = model_of(
        "codra: 1\nname: trips\ncontext: {goal: {of: driving, type: str, source: boss}}\n"
        "knowledge:\n  nodes: {robot: robot}\n"
        "  tasks: {driving: {from: robot, by: base, requesters: [boss], results: [there]}}\n"
        "agents: {base: {}, boss: {}}\n"
    )
    knowledge = Knowledge(made, clock=SimClock())

    knowledge.as_agent("boss").request("driving", goal="the shelf")

    assert knowledge.get("driving", "goal").value == "the shelf"


def test_initial_values_are_in_the_unit_of_the_attribute() -> None:
    assert find_model(model().nodes, "area_1").values == {"aisle": 3, "width": 2.5}


def test_initial_edges_are_those_without_a_writer_or_with_a_pose() -> None:
    assert [(edge.origin, edge.type, edge.target) for edge in model().edges] == [
        ("robot", "has", "battery"),
        ("robot", "eye_pose", "eye"),
        ("world", "area_pose", "area_1"),
    ]


def test_only_differences_to_the_defaults_of_the_runtime_are_emitted() -> None:
    homes = {"Motion": Motion}
    for name, defaults in KNOWLEDGE_DEFAULTS.items():
        kind = homes.get(name) or getattr(declarations, name)
        fields = {field.name: field for field in dataclasses.fields(kind)}
        for key, text in defaults.items():
            assert isinstance(text, str)
            factory = fields[key].default_factory
            taken = fields[key].default if factory is dataclasses.MISSING else factory()
            assert eval(text, {"math": math, "Pose": Pose}) == taken, f"{name}.{key}"


ANGLES = st.integers(-360, 360)


@given(ANGLES, ANGLES, ANGLES)
def test_a_pose_turns_about_fixed_axes_x_then_y_then_z(roll: int, pitch: int, yaw: int) -> None:
    made = model_of(
        "codra: 1\nname: turned\nknowledge:\n  nodes: {world: world, thing: thing}\n  edges:\n"
        "    stands: {label: RT, from: world, to: thing, static: true, "
        f"pose: {{x: 1 m, roll: {roll} deg, pitch: {pitch} deg, yaw: {yaw} deg}}}}\n"
    )
    turns = zip(((1, 0, 0), (0, 1, 0), (0, 0, 1)), (roll, pitch, yaw), strict=True)
    first, second, third = (Pose.about(axis, math.radians(angle)) for axis, angle in turns)

    pose = made.edges[0].pose

    assert pose.translation_m == (1.0, 0.0, 0.0)
    assert pose.angle_rad(third @ second @ first) < 1e-6


def test_every_declaration_makes_a_graph() -> None:
    knowledge = Knowledge(model(EVERYTHING), clock=SimClock())
    now = knowledge.snapshot()

    assert [node.name for node in now.nodes("place")] == ["dock", "door"]
    assert now.get("dock", "sign").value == '"dock"'
    assert now.in_view("door", "eye")
    assert now.distance_m("robot", "door") == 5.0
    for agent in knowledge.model.agents:
        for patterns in [*([pattern] for pattern in agent.wakes), *(rule.before for rule in agent.rules)]:
            assert not now.holds(*patterns)  # the graph has no values yet


# Patterns


def rule(agent: str, name: str) -> Any:
    return find_model(find_model(model().agents, agent).rules, name)


def test_paths_read_as_in_the_spec() -> None:
    assert rule("container_detection", "detect").before == (
        path("robot", "wants", "detecting"),
        absent(some("person"), "near", "robot"),
    )
    assert rule("picking", "approach").before[2] == path(
        "robot", "close_to", some("roll_container", called="it"), backward("near"), some("person")
    )


def test_conditions_name_the_nodes_of_their_attributes() -> None:
    assert repr(find_model(model().agents, "navigation").wakes[1]) == repr(value("battery.battery_level") < 10)
    assert repr(rule("container_detection", "detect").during[1]) == repr(value("robot.person_distance") > 1)


def test_distances_of_poses_are_in_metres() -> None:
    assert repr(find_model(model().agents, "fork").wakes[0]) == repr(distance("robot", "area_1") < 0.5)
    lift = rule("picking", "lift").before[1]
    assert repr(lift) == repr((value("battery.battery_level") > 20) & ~in_view("area_1", "eye"))


def test_a_text_that_looks_like_a_reading_stays_a_text() -> None:
    made = model_of(
        "codra: 1\nname: odd\ncontext: {word: {of: room, type: str, source: a}}\n"
        "knowledge: {nodes: {room: room}}\n"
        "agents:\n  a:\n    wakes: word == \"value('word')\"\n"
    )

    assert repr(made.agents[0].wakes[0]) == repr(value("room.word") == "value('word')")


def test_poses_in_conditions_hold_on_a_snapshot() -> None:
    clock = SimClock()
    knowledge = Knowledge(model(), clock=clock)
    near = find_model(model().agents, "fork").wakes[0]
    seen = in_view("area_1", "eye")
    assert not knowledge.snapshot().holds(near)  # the robot's pose is unknown

    knowledge.as_agent("navigation").place("world", "robot_pose", "robot", Pose.of((3.7, 2.0, 0.0)))

    assert knowledge.snapshot().holds(near)
    assert knowledge.snapshot().holds(~seen)  # the eye is on the robot and looks up


# Execution


def test_a_task_is_handed_over_between_handles(tmp_path: Path) -> None:
    with started(tmp_path) as codra:
        knowledge = codra.knowledge
        assert knowledge is not None
        picking, detection = knowledge.as_agent("picking"), knowledge.as_agent("container_detection")
        request = picking.request("detecting")
        assert knowledge.snapshot().holds(*rule("container_detection", "detect").before)
        detection.acknowledge(request)
        with detection.transaction() as transaction:
            transaction.insert_node("box", "roll_container")
            transaction.place("world", "container_pose", "box", Pose())
            transaction.finish(request, "found")

        assert knowledge.snapshot().handover("detecting").stage is Stage.FINISHED
        assert knowledge.snapshot().holds(*rule("container_detection", "detect").after)
        with pytest.raises(NotASourceError):
            picking.insert_node("another", "roll_container")


def test_a_handle_at_run_time_is_of_the_class_in_its_name(tmp_path: Path) -> None:
    with started(tmp_path) as codra:
        assert codra.knowledge is not None
        made = module(files(SPEC)["picking_up/knowledge.py"])

        assert isinstance(codra.knowledge, made.PickingUpKnowledge)
        assert isinstance(codra.knowledge.as_agent("picking"), made.PickingHandle)
        assert isinstance(codra.knowledge.snapshot(), made.PickingUpSnapshot)


def test_the_main_execution_asks_for_its_tasks_through_a_handle_of_its_own(tmp_path: Path) -> None:
    with started(tmp_path) as codra:
        main = codra.knowledge.as_agent("main_execution")
        request = main.request("picking_up")
        codra.agent("picking").graph.acknowledge(request)
        main.abort(request)

        assert codra.knowledge.snapshot().handover("picking_up").requester == "main_execution"
        with pytest.raises(NotASourceError):
            main.request("detecting")


def test_agents_of_templates_own_the_elements_of_their_uses(tmp_path: Path) -> None:
    with started(tmp_path, TWO_FORKS) as codra:
        assert codra.knowledge is not None
        front = codra.knowledge.as_agent("front_driver")
        front.insert_node("left_load", "front_load", side="left")

        assert codra.knowledge.get("left_load", "side").value == "left"
        assert find_model(model(TWO_FORKS).tasks, "lifting_back").by == "back_driver"


def test_a_tank_is_not_a_misspelt_task() -> None:
    made = model_of("codra: 1\nname: yard\nknowledge: {nodes: {tank: tank}}\nagents: {}\n")

    assert [(node.name, node.type) for node in made.nodes] == [("tank", "tank")]


def test_one_and_many_agents_with_long_names_are_formatted_as_by_ruff(tmp_path: Path) -> None:
    for count, long in ((1, "pump"), (60, "an_agent_with_a_name_that_says_all_that_it_is_there_for")):
        agents = [f"{long}_{number}" for number in range(count)]
        variables = "".join(f"  v{at}: {{of: tank, type: bool, source: {agent}}}\n" for at, agent in enumerate(agents))
        names = "".join(f"  {agent}: {{}}\n" for agent in agents)
        reads = ", ".join(f"v{at}" for at in range(count))
        text = (
            f"context:\n{variables}knowledge: {{nodes: {{tank: tank}}}}\nagents:\n{names}  it: {{reads: [{reads}]}}\n"
        )
        for name, written in emit(planned(f"codra: 1\nname: yard\n{text}")).items():
            (tmp_path / name).parent.mkdir(exist_ok=True)
            (tmp_path / name).write_text(written, "utf-8")
        command = [sys.executable, "-m", "ruff", "format", "--check", "--line-length", "120", str(tmp_path)]
        done = subprocess.run(command, text=True, capture_output=True, check=False, stdin=subprocess.DEVNULL)

        assert done.returncode == 0, done.stdout
        entry = (tmp_path / "yard/__init__.py").read_text("utf-8")
        imported = [line.strip(" ,") for line in entry.splitlines() if line.endswith("Handle,")]
        assert imported == sorted(imported, key=lambda name: int("".join(filter(str.isdecimal, name))))


NOBODY_WRITES = "codra: 1\nname: yard\nknowledge: {nodes: {tank: tank}}\nagents: {}\n"
ONE_WRITES = (
    "codra: 1\nname: yard\ncontext: {empty: {of: tank, type: bool, source: Node}}\n"
    "knowledge: {nodes: {tank: tank}}\nagents: {Node: {}, it: {reads: [empty]}}\n"
)


@pytest.mark.parametrize("text", [NOBODY_WRITES, ONE_WRITES, SPEC.read_text("utf-8"), EVERYTHING.read_text("utf-8")])
def test_the_module_of_knowledge_imports_exactly_what_it_uses(text: str, tmp_path: Path) -> None:
    written = next(text for name, text in emit(planned(text)).items() if name.endswith("/knowledge.py"))
    (tmp_path / "knowledge.py").write_text(written, "utf-8")
    command = [sys.executable, "-m", "ruff", "check", "--isolated", "--select", "F", str(tmp_path)]
    done = subprocess.run(command, text=True, capture_output=True, check=False, stdin=subprocess.DEVNULL)

    assert done.returncode == 0, done.stdout


def test_a_spec_without_knowledge_has_no_graph() -> None:
    text = "codra: 1\nname: plain\ncontext: {lit: {type: bool, source: lamp}}\nagents: {lamp: {}}\n"
    texts = emit(planned(text))

    assert sorted(texts) == [
        f"plain/{name}" for name in ("__init__.py", "graph.json", "manifest.json", "sources.json", "spec.py")
    ]
    assert "nowledge" not in "".join(text for name, text in texts.items())


def test_a_spec_file_called_knowledge_keeps_its_module() -> None:
    text = SPEC.read_text("utf-8")
    texts = dict(emit(plan_text(text, "specs/knowledge.yaml", ROOT).plans[0]))
    plain = plan_text(
        "codra: 1\nname: a\ncontext: {x: {type: bool, source: l}}\nagents: {l: {}}\n", "knowledge.yaml", ROOT
    )

    assert {"picking_up/knowledge.py", "picking_up/knowledge_.py"} <= set(texts)
    assert "a/knowledge.py" in emit(plain.plans[0])


# Form


@pytest.mark.parametrize("spec", [SPEC, EVERYTHING, TWO_FORKS], ids=lambda spec: spec.stem)
def test_the_module_is_formatted_as_by_ruff_and_has_no_findings(spec: Path, tmp_path: Path) -> None:
    for name, text in {"__init__.py": package_text(), **files(spec)}.items():
        (tmp_path / "generated" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "generated" / name).write_text(text, "utf-8")
    ruff = Path(sys.executable).with_name("ruff")
    own = ("--config", ROOT / "pyproject.toml", "--config", f"src = ['{ROOT}']", "--extend-ignore", "E501")
    for command in (("format", "--isolated", "--line-length", "120", "--diff"), ("check", *own)):
        done = subprocess.run((ruff, *command, tmp_path / "generated"), capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout


@given(HOSTILE, HOSTILE, HOSTILE)
def test_no_text_of_knowledge_in_a_spec_becomes_code(label: str, result: str, member: str) -> None:
    plan = planned(SPEC.read_text("utf-8"))
    knowledge = plan.checked.knowledge
    assert knowledge is not None
    world = knowledge.world
    task, kind = world.spec.tasks[0], world.spec.types[1]
    hostile_spec = dataclasses.replace(
        world.spec,
        tasks=(
            dataclasses.replace(task, label=label, results=(dataclasses.replace(task.results[0], name=result or "x"),)),
            *world.spec.tasks[1:],
        ),
        types=(dataclasses.replace(kind, label=member), *world.spec.types),
    )
    changed_knowledge = dataclasses.replace(knowledge, world=dataclasses.replace(world, spec=hostile_spec))
    text = emit(dataclasses.replace(plan, checked=dataclasses.replace(plan.checked, knowledge=changed_knowledge)))[
        "picking_up/knowledge.py"
    ]

    assert text.isascii()
    made = module(text).KNOWLEDGE
    assert (made.tasks[0].label, made.tasks[0].results) == (label if label != task.name else "", (result or "x",))
    called_names = {
        node.func.id
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    }
    assert called_names == {
        node.func.id
        for node in ast.walk(ast.parse(files(SPEC)["picking_up/knowledge.py"]))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    }


def test_the_module_imports_only_the_api_of_generated_code() -> None:
    tree = ast.parse(files(SPEC)["picking_up/knowledge.py"])
    homes = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}

    assert homes == {"contextlib", "typing", GENERATED_API}


# Files beside the code


def test_sources_have_the_place_of_every_element_and_rule() -> None:
    places = json.loads(files(SPEC)["picking_up/sources.json"])
    lines = SPEC.read_text("utf-8").splitlines()

    for name, word in (
        ("type/person", "person:"),
        ("type/robot", "robot: robot"),
        ("node/area_1", "area_1:"),
        ("edge/near", "near:"),
        ("task/detecting", "detecting:"),
        ("agent/picking", "picking:"),
        ("agent/picking/rules/lift", "lift:"),
        ("agent/picking/rules/lift/before/1", "battery.battery_level > 20"),
        ("agent/fork/wakes/0", "distance(robot, area_1)"),
    ):
        assert word in lines[places[f"picking_up/{name}"]["line"] - 1]


def test_the_graph_has_the_elements_and_tasks_of_agents() -> None:
    edges = json.loads(files(SPEC)["picking_up/graph.json"])["edges"]
    edge_texts = {f"{edge['source']} {edge['kind']} {edge['target']}".replace("picking_up/", "") for edge in edges}

    assert {
        "agent/fork owns type/roll_container",
        "agent/fork reads context/container_load",
        "agent/picking requests task/detecting",
        "agent/container_detection executes task/detecting",
        "edge/near leads_from type/person",
        "edge/near leads_to type/robot",
        "edge/eye_pose leads_to type/camera",
    } <= edge_texts
    assert "agent/picking reads task/detecting" not in edge_texts  # it requests the task


def test_the_manifest_changes_with_what_agents_own() -> None:
    text = SPEC.read_text("utf-8")
    changed_text = text.replace("picker_page: {}", "picker_page: {reads: [roll_container.weight]}")

    first, second = (json.loads(emit(planned(source))["picking_up/manifest.json"]) for source in (text, changed_text))

    assert first["model"] != second["model"]
    assert "knowledge.py" in first["outputs"]


# Types

PROGRAM = """\
from codra_dsl.runtime import SimClock
from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.knowledge import AgentHandle, Knowledge, Request, Transaction
from compiled import picking_up
from compiled.picking_up.knowledge import ContainerDetectionHandle, EdgeName, PickingHandle, TaskName


def ask(picking: PickingHandle) -> Request:
    return picking.request("detecting", wish="soon")


def detect(detection: ContainerDetectionHandle, request: Request) -> None:
    detection.acknowledge(request)
    with detection.transaction() as found:
        found.insert_node("box", "roll_container", weight=2.0)
        found.place("world", "container_pose", "box", Pose(), stamp_s=1.0)
        found.set("box", "weight", 3.0, evidence_s=1.0)
        found.insert_edge("robot", "close_to", "box")
        found.finish(request, "found")
    detection.delete_edge("robot", "close_to", "box")


def plain(handle: AgentHandle, graph: Knowledge, begun: Transaction) -> None:
    handle.set("robot", "anything", begun is not None and graph is not None)


task: TaskName = "detecting"
edge: EdgeName = "RT"
with picking_up.start(clock=SimClock(), resources={}) as codra:
    graph = codra.knowledge
    picking = graph.as_agent("picking")
    detection = graph.as_agent("container_detection")
    now = graph.snapshot()
    detect(detection, ask(picking))
    with picking.transaction() as begun:
        plain(picking, graph, begun)
    graph.as_agent("person_detection").set_of_edge("anna", "near", "robot", "distance", 0.5)
    with detection.acting("miss") as acting, acting.transaction() as first:
        first.insert_node("another", "roll_container")
    picking.close()
    ask(codra.agent("picking").graph)
    codra.agent("main_execution").graph.request("picking_up")
    codra.agent("navigation").set("battery_level", 50.0)
    print(graph.get("box", "weight").known, now.handover(task).stage, now.edges(edge, target="box"), now.nodes())
"""
WRONG = (
    'graph.as_agent("pickin")',
    'picking.request("detectin")',
    'picking.request("picking_up")',
    'picking.insert_node("box", "roll_container")',
    'detection.insert_node("box", "roll_contaner")',
    'detection.insert_node("anna", "person")',
    'detection.set("box", "full", True)',
    'detection.place("world", "robot_pose", "robot", Pose())',
    'detection.insert_edge("robot", "container_pose", "box")',
    'detection.finish(ask(picking), "there")',
    'graph.as_agent("person_detection").set_of_edge("anna", "near", "robot", "distnce", 0.5)',
    'graph.get("box", "wieght")',
    'now.handover("detectin")',
    'now.nodes("persn")',
    'now.edges("nar")',
    "ask(detection)",
    'first.insert_node("anna", "person")',
    'detection.acting("detct")',
    'codra.agent("pickin")',
    'codra.agent("container_detection").graph.insert_node("anna", "person")',
    'codra.agent("navigation").set("batery_level", 50.0)',
    'codra.agent("main_execution").graph.request("detecting")',
)


def test_mypy_reports_exactly_wrong_names_and_foreign_writes(tmp_path: Path) -> None:
    for name, text in {"__init__.py": package_text(), **files(SPEC)}.items():
        (tmp_path / PACKAGES / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / PACKAGES / name).write_text(text, "utf-8")
    program = PROGRAM + "".join(f"    {line}\n" for line in WRONG)

    errors = errors_in(program, tmp_path)

    assert [line for line, _ in errors] == list(WRONG)
