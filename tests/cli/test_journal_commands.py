"""`codra journal recover`, `codra replay` and `codra why` in real processes, on journals of real runs."""

from __future__ import annotations

import json
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.projects import run_program, run_project
from tests.cli.test_commands import ROOT, codra, environment

SPEC = """\
codra: 1
name: door
agents:
  house: {}
context:
  light_level: {type: float, unit: lux, range: [0, 2000], source: house, valid_for: 1 min}
  door_near: {type: bool, source: main_execution, valid_for: forever}
  door_open: {type: bool, valid_for: 30 s}
perception:
  look_at_door:
    call: door_perception:look_at_door
    returns:
      angle: {type: float, unit: rad, optional: true}
      edges: {type: int, range: [0, 20]}
    observable_when:
      - light_level > 20 lux
      - door_near
    accept_when:
      - edges >= 2
    identifies:
      door_open: angle > 30 deg
skills:
  open_door:
    preview: [door_open]
    monitor: [door_open]
    changes: [door_open]
"""

PERCEPTION = """\
def look_at_door(*, job):
    job.sleep(0.25)
    return {"angle": 1.0, "edges": 4 if job.index % 4 else 1}
"""

PROGRAM = """\
import sys
from codra_dsl.runtime import Journal, SimClock
from generated import door

clock = SimClock()
with door.start(clock=clock, resources={}, record=Journal(sys.argv[1])) as codra:
    codra.expect("open_door")
    clock.sleep(1.0)
    codra.agent("house").set("light_level", 300.0)
    clock.sleep(1.0)
    codra.set("door_near", True)
    clock.sleep(2.0)
    with codra.skill("open_door") as skill:
        codra.decide("door_open", otherwise=lambda: None)
        with skill.acting():
            clock.sleep(1.0)
    codra.declare("door_open")
    clock.sleep(2.5)
"""


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project whose program has run and written the journal `run.mcap`."""
    folder = tmp_path_factory.mktemp("project")
    files = {"specs/door.yaml": SPEC, "door_perception.py": PERCEPTION, "program.py": PROGRAM}
    run_project(folder, files, "run.mcap")
    return folder


def copied(project: Path, to: Path) -> Path:
    shutil.copytree(project, to / "project")
    return to / "project"


# Why


def test_why_leads_from_unknown_to_the_condition_that_was_missing_with_its_line(project: Path) -> None:
    process = codra("why", "door_open", "--journal", "run.mcap", "--at", "1.5 s", cwd=project)

    assert (process.returncode, process.stderr) == (0, "")
    assert process.stdout.splitlines() == [
        "door_open is unknown (never_observed) at 1.5 s  [specs/door.yaml:8]",
        "  not identified yet",
        "  observer look_at_door has been running since 0 s",
        "  declared since 0 s for expected",
        "  perception look_at_door cannot look  [specs/door.yaml:10]",
        "    door_near is unknown (never_observed) at 1.5 s  [specs/door.yaml:17]",
        "      not written yet; main_execution writes it",
        "  missing: door_near = true",
    ]


def test_why_leads_from_a_value_to_its_evidence_with_the_lines_of_the_rules(project: Path) -> None:
    process = codra("why", "door_open", "--journal", "run.mcap", "--at", "+3.9", cwd=project)

    assert process.returncode == 0
    assert "  perception look_at_door saw angle = 1 rad, edges = 4 (job 1)\n" in process.stdout
    assert "    by the rule: angle > 0.5235987755982988  [specs/door.yaml:21]\n" in process.stdout
    assert "    light_level > 20 lux holds  [specs/door.yaml:16]\n" in process.stdout
    assert "        written by agent house at 1 s\n" in process.stdout


def test_why_needs_neither_spec_nor_package(project: Path, tmp_path: Path) -> None:
    shutil.copy(project / "run.mcap", tmp_path)
    here, there = (
        codra("why", "door_open", "--journal", "run.mcap", "--at", "1.5", cwd=folder) for folder in (tmp_path, project)
    )

    assert here.stdout == there.stdout != ""


def test_why_looks_at_the_end_of_the_run_before_its_observers_stopped(project: Path) -> None:
    process = codra("why", "door_open", "--journal", "run.mcap", "--format", "json", cwd=project)

    explanation = json.loads(process.stdout)
    assert (explanation["at_s"], explanation["reading"]["content"], explanation["missing"]) == (7.5, True, [])
    place = {"file": "specs/door.yaml", "line": 21, "use": None, "site": None, "replaces": None}
    assert explanation["look"]["place"] == place


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["door_opn", "--journal", "run.mcap"],
            "the spec has no context-variable 'door_opn': did you mean 'door_open'?",
        ),
        (
            ["door_open", "--journal", "run.mcap", "--at", "soon"],
            "'soon' is not an instant such as '31.5', '+2 min', or '2030-01-31 03:12:05' in UTC",
        ),
        (["door_open", "--journal", "run.mcap", "--at", "99"], "the journal holds 0 s to 7.5 s, not 99 s"),
        (["door_open", "--journal", "run.mcap", "--at", "-5"], "the journal holds 0 s to 7.5 s, not -5 s"),
        (["door_open", "--journal", "run.mcap", "--at", "nan"], "'nan' is not an instant"),
        (["door_open", "--journal", "missing.mcap"], "'missing.mcap' does not exist"),
        (["door_open"], "give either --journal or --connect"),
    ],
)
def test_a_question_without_an_answer_is_a_usage_error(project: Path, arguments: list[str], message: str) -> None:
    process = codra("why", *arguments, cwd=project)

    assert (process.returncode, process.stdout) == (2, "")
    assert message in " ".join(process.stderr.split())


def test_the_events_of_a_run_are_shown_one_a_line(project: Path) -> None:
    all_of_it = codra("journal", "show", "run.mcap", cwd=project)
    decisions = codra("journal", "show", "run.mcap", "--kind", "decision", cwd=project)
    about = codra("journal", "show", "run.mcap", "--about", "door_near", "--about", "light_level", cwd=project)

    assert decisions.stdout == (
        '4 s  decision door_open answered  {"value":true,"asked_s":4.0,"source":"look_at_door","skill":"open_door"}\n'
    )
    assert decisions.stdout in all_of_it.stdout
    assert [line.split("  ")[1] for line in about.stdout.splitlines()] == [
        "variable light_level identified",
        "variable door_near identified",
    ]
    assert "input" not in {line.split("  ")[1].split()[0] for line in all_of_it.stdout.splitlines()}
    refused = codra("journal", "show", "run.mcap", "--kind", "descision", cwd=project)
    assert refused.returncode == 2
    kinds = (
        "variable, override, observer, job, host, decision, preview, declaration, expectation, knowledge, adaptation, "
        "input"
    )
    assert f"'descision' is not a kind; choose from {kinds}" in " ".join(refused.stderr.split())


def test_why_explains_the_preview_of_a_skill_and_suggests_its_name(project: Path) -> None:
    explained = codra("why", "open_door", "--journal", "run.mcap", "--at", "4", cwd=project)
    misspelt = codra("why", "opn_door", "--journal", "run.mcap", cwd=project)

    assert explained.stdout.splitlines()[:2] == [
        "open_door is unknown (invalidated) at 4 s  [specs/door.yaml:23]",
        "  the preview is unknown: door_open (invalidated: open_door)",
    ]
    assert "did you mean 'open_door'?" in misspelt.stderr


def test_an_instant_may_be_the_time_of_day(project: Path, tmp_path: Path) -> None:
    """The clock of this run shows the seconds since 1970."""
    elsewhere = copied(project, tmp_path)
    program = PROGRAM.replace("SimClock()", "SimClock(1_795_245_600.0)")
    (elsewhere / "program.py").write_text(program)
    run_program(elsewhere, "program.py", "run.mcap")
    explanations = {
        codra("why", "door_near", "--journal", "run.mcap", "--at", at, cwd=elsewhere).stdout
        for at in (
            "+3",
            "1795245603",
            "2026-11-21 07:20:03",
            "2026-11-21T08:20:03+01:00",
            "2026-11-21 07:20:03.000 UTC",
        )
    }

    assert [text.splitlines()[0] for text in explanations] == [
        "door_near is true at 2026-11-21 07:20:03.000 UTC  [specs/door.yaml:7]"
    ]


# Replay


def test_a_replay_with_the_compiled_package_is_equal(project: Path, tmp_path: Path) -> None:
    process = codra("replay", "run.mcap", "--journal", f"{tmp_path}/again.mcap", cwd=project)

    assert (process.returncode, process.stderr) == (0, "codra: the replay runs the package 'generated/door'\n")
    assert process.stdout.startswith("equal: ")
    assert (tmp_path / "again.mcap").read_bytes() == (project / "run.mcap").read_bytes()


def test_a_replay_whose_journal_cannot_be_written_completely_fails(project: Path) -> None:
    def limit_files() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (8192, 8192))

    command = [sys.executable, "-m", "codra_dsl", "replay", "run.mcap", "--journal", "short.mcap"]
    process = subprocess.run(
        command, cwd=project, env=environment(), text=True, capture_output=True, check=False, preexec_fn=limit_files
    )

    assert "equal: " in process.stdout
    assert "codra: 'short.mcap' is incomplete: OSError: " in process.stderr
    assert process.returncode == 1


def test_a_replay_calls_no_perception_function(project: Path, tmp_path: Path) -> None:
    elsewhere = copied(project, tmp_path)
    (elsewhere / "door_perception.py").unlink()

    assert codra("replay", "run.mcap", cwd=elsewhere).returncode == 0


def test_another_threshold_is_reported_at_its_first_consequence_with_its_line(project: Path, tmp_path: Path) -> None:
    elsewhere = copied(project, tmp_path)
    (elsewhere / "specs/door.yaml").write_text(SPEC.replace("angle > 30 deg", "angle > 80 deg"))
    process = codra("replay", "run.mcap", "--spec", "specs/door.yaml", cwd=elsewhere)

    assert process.returncode == 1
    assert "the package differs from the one that ran" in process.stderr
    first, recorded, derived = process.stdout.splitlines()[:3]
    assert first.endswith("variable door_open  [specs/door.yaml:21]")
    assert '"value":true' in recorded
    assert '"value":false' in derived


def test_another_precondition_is_reported_at_the_first_look_that_it_prevents(project: Path, tmp_path: Path) -> None:
    elsewhere = copied(project, tmp_path)
    (elsewhere / "specs/door.yaml").write_text(SPEC.replace("light_level > 20 lux", "light_level > 500 lux"))
    assert codra("compile", "specs", cwd=elsewhere).returncode == 0
    process = codra("replay", "run.mcap", cwd=elsewhere)

    assert process.returncode == 1
    lines = process.stdout.splitlines()
    assert lines[0].endswith(" 2 s: job look_at_door for door_open  [specs/door.yaml:10]")
    assert lines[3] == (
        "  the spec differs: look_at_door, observable_when: light_level > 500 lux [specs/door.yaml:16]; "
        "the run had light_level > 20 lux [specs/door.yaml:16]"
    )
    assert "no event in its place" in process.stdout


def test_a_comment_in_the_spec_makes_no_difference(project: Path, tmp_path: Path) -> None:
    elsewhere = copied(project, tmp_path)
    (elsewhere / "specs/door.yaml").write_text(f"# One more line.\n{SPEC}")
    process = codra("replay", "run.mcap", "--spec", "specs/door.yaml", cwd=elsewhere)

    assert (process.returncode, process.stderr) == (0, "codra: the replay runs the package of 'specs/door.yaml'\n")


def test_a_replay_can_be_read_by_programs(project: Path, tmp_path: Path) -> None:
    elsewhere = copied(project, tmp_path)
    (elsewhere / "specs/door.yaml").write_text(SPEC.replace("angle > 30 deg", "angle > 80 deg"))
    equal, different = (
        json.loads(codra("replay", "run.mcap", "--format", "json", *arguments, cwd=elsewhere).stdout)
        for arguments in ((), ("--spec", "specs/door.yaml"))
    )

    assert (equal["difference"], equal["absent"]) == (None, [])
    assert equal["compared"] == sum(equal["derived"].values())
    difference = different["difference"]
    assert difference["position"] == different["compared"] + 1
    assert [difference[side]["details"]["value"] for side in ("recorded", "replayed")] == [True, False]
    assert [(change["owner"], change["what"]) for change in difference["changes"]] == [
        ("look_at_door", "identifies door_open")
    ]


def test_after_a_difference_the_decisions_are_counted(project: Path, tmp_path: Path) -> None:
    elsewhere = copied(project, tmp_path)
    (elsewhere / "specs/door.yaml").write_text(SPEC.replace("angle > 30 deg", "angle > 80 deg"))
    text, data = (
        codra("replay", "run.mcap", "--spec", "specs/door.yaml", *arguments, cwd=elsewhere).stdout
        for arguments in ((), ("--format", "json", "--to", "4.2"))
    )

    assert text.splitlines()[4:] == [
        "decisions: context would have answered 1 of 1; in the run, context answered 1",
        "  door_open: 1 of 1, in the run 1 (1 answered with another value)",
    ]
    counts = {"decisions": 1, "recorded": 1, "replayed": 1, "gained": 0, "lost": 0, "other_value": 1}
    result = json.loads(data)
    assert result["decisions"] == {"door_open": {**counts, "unknown": 0, "assumed": 0}}
    assert (result["missing_looks"], result["skipped_inputs"], result["ended_because"]) == ({}, {}, "")


def test_a_replay_of_a_range_of_time_counts_only_events_of_this_range(project: Path) -> None:
    process = codra("replay", "run.mcap", "--from", "2.0", "--to", "+2.5 s", cwd=project)
    shown = codra("journal", "show", "run.mcap", "--from", "2.0", "--to", "+2.5 s", cwd=project)

    assert process.returncode == 0
    assert process.stdout.startswith(f"equal: {len(shown.stdout.splitlines())} events\n")


def test_events_of_a_range_are_shown_as_json_lines(project: Path) -> None:
    process = codra("journal", "show", "run.mcap", "--kind", "variable", "--to", "1 s", "--format", "json", cwd=project)

    assert [json.loads(line) for line in process.stdout.splitlines()] == [
        {
            "kind": "variable",
            "instant_s": 1.0,
            "name": "light_level",
            "what": "identified",
            "value": 300.0,
            "detail": "",
            "evidence_s": 1.0,
            "source": "house",
            "present": True,
        }
    ]


@pytest.mark.parametrize("command", [("replay",), ("journal", "show")])
def test_an_empty_range_of_time_is_a_usage_error(project: Path, command: tuple[str, ...]) -> None:
    for arguments, message in (
        (("--from", "3", "--to", "2"), "Invalid value for --to: '2' is before --from"),
        (("--to", "-1"), "Invalid value for --to: '-1' is before the start of the run"),
        (("--from", "soon"), "Invalid value for --from: 'soon' is not an instant"),
    ):
        process = codra(*command, "run.mcap", *arguments, cwd=project)
        assert process.returncode == 2
        assert message in process.stderr.replace("\n", " ")


def test_a_replay_of_a_time_after_the_run_is_a_usage_error(project: Path) -> None:
    process = codra("replay", "run.mcap", "--from", "99", cwd=project)
    assert process.returncode == 2
    assert "Invalid value for --from: '99' is after the end of the run" in process.stderr.replace("\n", " ")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--package", "specs"], "'specs' is not a package of codra that can be loaded"),
        (["--spec", "program.py"], "does not compile to one package"),
    ],
)
def test_a_package_that_cannot_be_loaded_is_named(project: Path, arguments: list[str], message: str) -> None:
    process = codra("replay", "run.mcap", *arguments, cwd=project)

    assert (process.returncode, process.stdout, "Traceback" in process.stderr) == (1, "", False)
    assert message in process.stderr


def test_without_a_package_the_options_are_named(project: Path, tmp_path: Path) -> None:
    shutil.copy(project / "run.mcap", tmp_path)
    process = codra("replay", "run.mcap", cwd=tmp_path)

    assert (process.returncode, process.stdout) == (2, "")
    assert "use --package or --spec" in " ".join(process.stderr.replace("│", " ").split())


# Recover


def test_a_damaged_journal_is_reported_read_and_repaired(project: Path, tmp_path: Path) -> None:
    elsewhere = copied(project, tmp_path)
    journal_bytes = (elsewhere / "run.mcap").read_bytes()
    (elsewhere / "torn.mcap").write_bytes(journal_bytes[:-9])

    why = codra("why", "door_open", "--journal", "torn.mcap", cwd=elsewhere)
    assert why.returncode == 0
    assert why.stderr == "codra: 'torn.mcap' lacks its end: it holds what happened up to 7.5 s\n"
    process = codra("journal", "recover", "torn.mcap", cwd=elsewhere)
    assert (process.returncode, process.stderr) == (0, "")
    assert process.stdout.startswith("torn.recovered.mcap: ")
    assert "lost at the end: at most the message that was being written" in process.stdout
    assert (elsewhere / "torn.recovered.mcap").read_bytes() == journal_bytes
    assert codra("replay", "torn.mcap", cwd=elsewhere).returncode == 0


def test_a_complete_journal_is_reported_as_complete(project: Path, tmp_path: Path) -> None:
    process = codra("journal", "recover", "run.mcap", "--output", f"{tmp_path}/same.mcap", cwd=project)

    assert (process.returncode, "the journal was complete: nothing was lost" in process.stdout) == (0, True)
    assert (tmp_path / "same.mcap").read_bytes() == (project / "run.mcap").read_bytes()


@pytest.mark.parametrize("command", [["journal", "recover"], ["replay"], ["why", "door_open", "--journal"]])
def test_a_file_of_another_kind_is_refused_without_a_traceback(project: Path, command: list[str]) -> None:
    process = codra(*command, "specs/door.yaml", cwd=project)

    assert (process.returncode, process.stdout) == (1, "")
    assert process.stderr == "codra: specs/door.yaml is not an MCAP file\n"


def test_the_journal_itself_is_never_the_target(project: Path) -> None:
    for arguments in (["journal", "recover", "run.mcap", "--output"], ["replay", "run.mcap", "--journal"]):
        process = codra(*arguments, "./run.mcap", cwd=project)

        assert process.returncode == 2
        assert "is the journal itself" in " ".join(process.stderr.split())


# The laboratory


def test_a_run_in_the_laboratory_is_derived_again_from_its_journal(tmp_path: Path) -> None:
    """The run is ten simulated seconds of rendered frames; the replay renders none and uses the compiled package."""
    for name in ("a.mcap", "b.mcap"):
        arguments = ("--seed", "2", "--for", "10 s", "--journal", f"{tmp_path}/{name}", "--out", f"{tmp_path}/out")
        assert codra("run", "specs/lab.yaml", *arguments, cwd=ROOT).returncode == 0
    process = codra("replay", f"{tmp_path}/a.mcap", "--journal", f"{tmp_path}/c.mcap", cwd=ROOT)

    assert (process.returncode, process.stderr) == (0, "codra: the replay runs the package 'generated/lab'\n")
    contents = [(tmp_path / name).read_bytes() for name in ("a.mcap", "b.mcap", "c.mcap")]
    assert contents[0] == contents[1] == contents[2]


def test_the_naive_arm_writes_a_journal_of_its_own(tmp_path: Path) -> None:
    files = ("--journal", f"{tmp_path}/run.mcap", "--out", f"{tmp_path}/out")
    assert codra("run", "specs/lab.yaml", "--naive", "--for", "4 s", *files, cwd=ROOT).returncode == 0
    own, naive = (
        codra("journal", "show", f"{tmp_path}/{name}", "--kind", "job", "--what", "started", cwd=ROOT).stdout
        for name in ("run.mcap", "run.naive.mcap")
    )

    assert "job localize_centrifuge_lid started" in naive
    assert "job localize_centrifuge_lid started" not in own


def test_a_journal_that_cannot_be_made_is_refused_before_the_run(tmp_path: Path) -> None:
    process = codra("run", str(ROOT / "specs/lab.yaml"), "--journal", "missing/run.mcap", cwd=tmp_path)

    assert (process.returncode, process.stdout) == (2, "")
    assert "cannot write 'missing/run.mcap': No such file or directory" in " ".join(process.stderr.split())
