"""Timelines that place poses in the knowledge graph, run loops, and check what skills expect."""

from __future__ import annotations

import pytest

from codra_dsl.integrations.testing.loops import StatedRobot
from codra_dsl.integrations.testing.run import Run, StoryFailed
from codra_dsl.integrations.testing.timeline import LeafBehaviour
from codra_dsl.runtime import Event, Kind, SimClock
from codra_dsl.runtime.behavior_trees import Ports, Result, Scope
from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.knowledge import AgentTakenError
from codra_dsl.runtime.knowledge.operations import Operation, Verb
from codra_dsl.runtime.loops import Mape
from generated.store.knowledge import KNOWLEDGE
from generated.store.mape import MAPE
from tests.integrations.testing.timelines import HEAD, findings, run_of_only_story

STORE = "codra: 1\ntimeline: store\n"
PERSON = "{world -person_pose-> ann: {x: 6 m, y: 2 m}, ann -near-> robot: present}"
ORDER = """\
start:
  agents:
    localisation: {pose_spread: 3 cm}
    navigation: {battery_level: 80 percent, bumped: false}
    person_detection: {person_distance: 6 m}
    lasers: {strange_gap: 5 m}
    picker_page: {container_load: empty}
    mission: {order_open: true}
    picking: {picking_up: false}
    fork: {loaded: false}
  loops: {mission: runs}
"""
AGENTS = """\
agents:
  localisation: {every: 1 s}
  lasers: {every: 1 s}
  person_detection: {every: 1 s}
  navigation: {every: 1 s}
"""
READY = "{robot_is_localized: true, robot_place: counter, light_is_on: true}"
FRIDGE = f"""\
start:
  perception:
    measure_fridge: {{returns: {{distance: 50 cm}}}}
    look_at_fridge: {{returns: {{angle: 0 deg, edges: 10}}}}
  main_execution: {{set: {READY}, begin: [open_fridge], act: [open_fridge]}}
"""


def played(text: str) -> Run:
    run = run_of_only_story(STORE + text)
    run.play()
    return run


def failure_text(text: str) -> str:
    with pytest.raises(StoryFailed) as error_info:
        run_of_only_story(text).play()
    return str(error_info.value)


def placements_of_robot(run: Run) -> list[Event]:
    events = run.record.of(Kind.KNOWLEDGE)
    return [event for event in events if (event.name, event.what) == ("world -robot_pose-> robot", "placed")]


# Poses


def test_a_pose_is_written_by_an_agent_of_its_edge_as_the_spec_writes_poses() -> None:
    run = played("stories: {case: {2 s: {poses: {world -robot_pose-> robot: {x: 50 cm, yaw: 90 deg}}}, 3 s: {}}}")

    (event,) = [
        event for event in run.record.of(Kind.KNOWLEDGE) if event.what == "placed" and event.name.endswith("-> robot")
    ]
    assert (event.instant_s, event.details["agent"]) == (2.0, "localisation")
    transform = run.codra.knowledge.at(3.0).transform("world", "robot", 2.0)
    assert transform.pose.translation_m == (0.5, 0.0, 0.0)
    assert transform.pose.angle_rad(Pose.about((0, 0, 1), 1.5707963267948966)) == pytest.approx(0.0, abs=1e-6)


def test_rotations_are_those_of_a_pose_in_the_spec() -> None:
    (edge,) = [edge for edge in KNOWLEDGE.edges if edge.type == "camera_at"]
    run = played("stories: {case: {0 s: {poses: {world -robot_pose-> robot: {roll: -90 deg, yaw: -90 deg}}}}}")

    pose = run.codra.knowledge.at(0.0).transform("world", "robot", 0.0).pose
    assert pose.angle_rad(edge.pose) == pytest.approx(0.0, abs=1e-6)


def test_nodes_are_inserted_and_removed_with_their_edges() -> None:
    run = played(f"stories: {{case: {{1 s: {{poses: {PERSON}}}, 2 s: {{poses: {{ann: gone}}}}, 3 s: {{}}}}}}")

    graph = run.codra.knowledge
    assert graph.at(1.5).has_edge("ann", "near", "robot")
    assert "ann" not in graph.at(2.5)


def test_an_agent_repeats_its_last_poses_until_it_is_silent() -> None:
    run = played(
        "agents: {localisation: {every: 1 s}}\nstories:\n  case:\n"
        "    0 s: {poses: {world -robot_pose-> robot: {x: 1 m}}}\n"
        "    2500 ms: {agents: {localisation: silent}}\n    9 s: {}\n"
    )

    placed = [
        event.instant_s
        for event in run.record.of(Kind.KNOWLEDGE)
        if event.what == "placed" and event.name.endswith("-> robot")
    ]
    assert placed == [0.0, 1.0, 2.0]


def test_a_change_that_the_graph_refuses_fails_with_its_place() -> None:
    text = failure_text(f"{STORE}stories: {{case: {{1 s: {{poses: {{ann: gone}}}}, 2 s: {{}}}}}}\n")

    assert text.startswith("tests/case.timeline.yaml:3:32: the graph does not allow this: AbsentError: ")


@pytest.mark.parametrize("source", ["other context-variables", "the knowledge graph"])
def test_what_follows_from_other_context_or_from_the_graph_has_no_agent(source: str) -> None:
    (finding,) = findings(f"{STORE}stories: {{case: {{1 s: {{agents: {{{source}: {{full_on_fork: true}}}}}}}}}}\n")

    assert finding.message == f"spec 'store' has no agent '{source}'"
    assert "other context-variables" not in finding.help


def test_a_repetition_that_the_graph_refuses_fails_with_the_place_of_what_is_repeated() -> None:
    run = run_of_only_story(
        f"{STORE}agents: {{person_detection: {{every: 1 s}}}}\nstories:\n  case:\n"
        f"    1 s: {{poses: {PERSON}}}\n    3 s: {{}}\n"
    )
    with run:
        run.until(1.5)
        run.codra.knowledge.write_as("person_detection", [Operation(Verb.DELETE_NODE, ("ann",))])
        container = Operation(Verb.INSERT_NODE, ("ann", "roll_container", {}))
        run.codra.knowledge.write_as("container_detection", [container])
        with pytest.raises(StoryFailed, match=r"^tests/case.timeline.yaml:6:19: the graph does not allow this: "):
            run.until(2.0)


def test_a_program_that_opens_the_loops_of_a_story_gets_an_error() -> None:
    run = run_of_only_story(f"{STORE}stories: {{case: {{0 s: {{loops: {{mission: runs}}}}, 2 s: {{}}}}}}\n")
    with run, pytest.raises(AgentTakenError) as error_info:
        Mape(run.codra, MAPE, clock=run.clock, robot=StatedRobot(run.clock))
    assert str(error_info.value) == (
        "the loops cannot write as agent 'analysis': it has an open handle (perhaps of other loops): close it. "
        "In a story, run the loops either by 'loops' of the story or by the program"
    )
    assert error_info.value.__suppress_context__


def test_a_loop_that_a_program_already_runs_fails_with_the_place_at_which_the_story_starts_it() -> None:
    run = run_of_only_story(f"{STORE}stories: {{case: {{1 s: {{loops: {{mission: runs}}}}, 2 s: {{}}}}}}\n")
    with run:
        loops = Mape(run.codra, MAPE, clock=run.clock, robot=StatedRobot(run.clock))
        with pytest.raises(StoryFailed, match=r"^tests/case.timeline.yaml:3:32: the loop cannot run: AgentTaken"):
            run.until(1.0)
        loops.close()


@pytest.mark.parametrize(
    ("section", "message", "help_text"),
    [
        ("poses: {robot_pose: {x: 1 m}}", "'robot_pose' is not an edge", "write it as in patterns"),
        (
            "poses: {world -robot_poes-> robot: {x: 1 m}}",
            "spec 'store' has no edge 'robot_poes'",
            "did you mean 'robot_pose'?",
        ),
        (
            "poses: {world -robot_pose-> robt: {x: 1 m}}",
            "spec 'store' has no node 'robt'",
            "did you mean 'robot'?",
        ),
        ("poses: {base -robot_pose-> robot: {x: 1 m}}", "this edge cannot have node 'base' there", "can have 'world'"),
        ("poses: {world -dock_at-> dock: {x: 1 m}}", "edge 'dock_at' may be written by no agent", "name an agent"),
        ("poses: {world -robot_pose-> robot: present}", "edge 'robot_pose' has a pose", "write the pose"),
        ("poses: {ann -near-> robot: {x: 1 m}}", "edge 'near' has no pose", "write 'present' or 'gone'"),
        ("poses: {robot: gone}", "node 'robot' may be deleted by no agent", "name an agent"),
        (
            "poses: {world -robot_pose-> robot: {x: 1 s}}",
            "'x' in timeline 'store' must be a length, not '1 s'",
            "0.5 m",
        ),
        (
            "poses: {world -robot_pose-> robot: {yow: 1 deg}}",
            "unknown key 'yow' in 'world -robot_pose-> robot' of timeline 'store'",
            "did you mean 'yaw'?",
        ),
        (
            "leaves: {MoveTo: {retuns: success}}",
            "unknown key 'retuns' in 'MoveTo' of timeline 'store'",
            "did you mean 'returns'?",
        ),
        ("loops: {mision: runs}", "spec 'store' has no loop 'mision'", "did you mean 'mission'?"),
        ("loops: {mission: stops}", "loop 'mission' is not running", "let it run first"),
        (
            "leaves: {MoveTwo: {returns: success}}",
            "no tree of spec 'store' has a leaf 'MoveTwo'",
            "did you mean 'MoveTo'?",
        ),
    ],
)
def test_a_mistake_about_the_graph_or_a_loop_is_reported_with_help(section: str, message: str, help_text: str) -> None:
    (mistake,) = findings(f"{STORE}stories: {{case: {{1 s: {{{section}}}}}}}\n")

    assert mistake.message == message
    assert help_text in mistake.help
    assert mistake.place.span.line == 3


# Loops


def test_a_loop_runs_from_the_instant_at_which_the_story_starts_it_until_it_stops() -> None:
    run = played(
        f"{AGENTS}{ORDER}stories:\n  case:\n"
        "    5 s: {believes: {max_speed: 1.2 m/s}, loops: {mission: stops}}\n"
        "    6 s: {agents: {person_detection: {person_distance: 1 m}}}\n"
        "    9 s: {believes: {max_speed: {is: 1.2 m/s, source: adaptation}}}\n"
    )

    loop_events = [event for event in run.record.of(Kind.ADAPTATION, "mission") if event.what in ("started", "stopped")]
    assert [(event.what, event.instant_s) for event in loop_events] == [("started", 0.0), ("stopped", 5.0)]


def test_a_leaf_returns_what_the_story_states_after_the_stated_time() -> None:
    clock = SimClock(10.0)
    robot = StatedRobot(clock)
    action, ports = robot.of("MoveTo"), Ports("MoveTo", Scope(), {}, {})
    assert action.start(ports) is Result.RUNNING

    robot.behaviours["MoveTo"] = LeafBehaviour(leaf="MoveTo", result=Result.FAILURE, takes_s=3.0)
    results = []
    for _ in range(4):
        results.append(action.go_on(ports))
        clock.sleep(1.0)
    assert results == [Result.RUNNING] * 3 + [Result.FAILURE]
    assert action.start(ports) is Result.RUNNING


# Expectations


@pytest.mark.parametrize("angle", ["60 deg", "0 deg"])
def test_the_last_outcome_of_what_a_skill_expects_is_checked(angle: str) -> None:
    story = f"""\
stories:
  case:
    1 s: {{perception: {{look_at_fridge: {{returns: {{angle: {angle}}}}}}}}}
    20 s:
      main_execution: {{acted: [open_fridge], end: [open_fridge]}}
      expects: {{open_fridge: {{fridge_open: met}}}}
"""
    if angle == "60 deg":
        run_of_only_story(HEAD + FRIDGE + story).play()
    else:
        assert "by 20 s the expectation of open_fridge about fridge_open should be met, but at" in failure_text(
            HEAD + FRIDGE + story
        )


def test_an_expectation_without_an_outcome_fails_the_check() -> None:
    text = failure_text(
        f"{HEAD}{FRIDGE}stories: {{case: {{0 s: {{expects: {{open_fridge: {{fridge_open: met}}}}}}}}}}\n"
    )

    assert "should be met, but it has no outcome yet" in text


def test_a_skill_that_expects_nothing_of_a_variable_is_reported() -> None:
    (mistake,) = findings(f"{HEAD}stories: {{case: {{1 s: {{expects: {{open_fridge: {{hob_on: met}}}}}}}}}}\n")

    assert mistake.message == "skill 'open_fridge' expects nothing of 'hob_on'"
    assert "fridge_open" in mistake.help
