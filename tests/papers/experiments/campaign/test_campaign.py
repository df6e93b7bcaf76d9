"""Trials in separate processes: their records, repeated runs, and reports of failures."""

from __future__ import annotations

import multiprocessing
import shutil
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from codra_dsl.integrations.inspection import SpecError
from codra_papers.experiments.campaign import trial_records
from codra_papers.experiments.campaign.campaign import (
    TRIALS,
    CampaignBusyError,
    Progress,
    Runner,
    local_processes,
    run_campaign,
)
from codra_papers.experiments.campaign.trial_records import records_of
from codra_papers.experiments.campaign.workers import TrialError
from codra_papers.experiments.lab.arms import NAIVE, NEED
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.lab.run import Loops, Work
from codra_papers.experiments.lab.trials import Trial
from codra_papers.lab.simulator import gl
from tests.papers.experiments.workloads import Dies, Exits, Raises, wanders

SPECS = Path(__file__).parents[4] / "specs"
RECORD_NAMES = ("seed 301.json", "seed 302.json")


def trial(seed: int = 301, work: Work | None = None, spec: Path = SPECS / "lab.yaml") -> Trial:
    return Trial(
        name=f"seed {seed}",
        spec=spec,
        seed=seed,
        arms=(NEED, NAIVE),
        work=work or Loops(),
        duration_s=8.0,
        frames_kept=2,
    )


TWO_TRIALS = (trial(301), trial(302))
TWO_PROCESSES = local_processes(2)


def run(
    folder: Path, trials: tuple[Trial, ...] = TWO_TRIALS, runner: Runner = TWO_PROCESSES
) -> tuple[Mapping[str, Outcome], list[Progress]]:
    reports: list[Progress] = []
    return run_campaign(trials, folder, run=runner, progress=reports.append), reports


@pytest.fixture(scope="module")
def uninterrupted_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a campaign of two trials."""
    folder = tmp_path_factory.mktemp("undisturbed")
    run(folder)
    return folder


@pytest.fixture
def copied_folder(uninterrupted_folder: Path, tmp_path: Path) -> Path:
    """Return a copy of the folder of `uninterrupted_folder`."""
    return Path(shutil.copytree(uninterrupted_folder, tmp_path / "kept"))


def files(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def changed_records(before: Mapping[str, int], folder: Path) -> set[str]:
    """Return the record files that were written since `before`."""
    return {name for name, number in inodes(folder).items() if before.get(name) != number}


def inodes(folder: Path) -> dict[str, int]:
    return {path.name: path.stat().st_ino for path in (folder / TRIALS).glob("*.json")}


def test_a_campaign_keeps_a_record_and_the_frames_of_every_trial_and_no_other_file(uninterrupted_folder: Path) -> None:
    names = {Path(name).parts[1] for name in files(uninterrupted_folder)}

    assert names == {*RECORD_NAMES, "seed 301", "seed 302"}
    assert len(list((uninterrupted_folder / TRIALS / "seed 301").glob("*.png"))) == 2


def test_one_process_gives_the_same_bytes_as_two(uninterrupted_folder: Path, tmp_path: Path) -> None:
    outcomes, reports = run(tmp_path, runner=local_processes(1))

    assert files(tmp_path) == files(uninterrupted_folder)
    assert list(outcomes) == ["seed 301", "seed 302"]
    assert [(report.done, report.total, report.reused_trial_count, report.latest) for report in reports] == [
        (0, 2, 0, ""),
        (1, 2, 0, "seed 301"),
        (2, 2, 0, "seed 302"),
    ]


def test_a_trial_with_a_record_is_not_run_again_and_gives_the_same_outcome(copied_folder: Path) -> None:
    before = inodes(copied_folder)
    outcomes, reports = run(copied_folder)

    assert changed_records(before, copied_folder) == set()
    assert [(report.done, report.reused_trial_count) for report in reports] == [(2, 2)]
    assert {name: outcome.seed for name, outcome in outcomes.items()} == {"seed 301": 301, "seed 302": 302}
    assert outcomes["seed 301"].arms.keys() == {NEED.name, NAIVE.name}


def truncate(folder: Path) -> None:
    path = folder / RECORD_NAMES[0]
    path.write_bytes(path.read_bytes()[:-200])


def add_a_digit(folder: Path) -> None:
    path = folder / RECORD_NAMES[0]
    path.write_text(path.read_text().replace('"frames":', '"frames":1'))


def lose_a_frame(folder: Path) -> None:
    min((folder / "seed 301").glob("*.png")).unlink()


def take_another_trials(folder: Path) -> None:
    shutil.copy(folder / RECORD_NAMES[1], folder / RECORD_NAMES[0])


def write_something_else(folder: Path) -> None:
    (folder / RECORD_NAMES[0]).write_bytes(b"\xff\xfe[]")


@pytest.mark.parametrize("damage", [truncate, add_a_digit, lose_a_frame, take_another_trials, write_something_else])
def test_a_record_that_is_damaged_or_of_another_trial_is_ignored(
    copied_folder: Path, damage: Callable[[Path], None]
) -> None:
    damage(copied_folder / TRIALS)

    assert [record.read() is None for record in records_of(TWO_TRIALS, copied_folder / TRIALS)] == [True, False]


def test_only_missing_records_are_made_again_and_then_all_files_are_the_same(
    uninterrupted_folder: Path, copied_folder: Path
) -> None:
    before = inodes(copied_folder)
    add_a_digit(copied_folder / TRIALS)
    _, reports = run(copied_folder)

    assert reports[0].reused_trial_count == 1
    assert changed_records(before, copied_folder) == {RECORD_NAMES[0]}
    assert files(copied_folder) == files(uninterrupted_folder)


def test_another_trial_of_the_same_name_replaces_record_and_frames(copied_folder: Path) -> None:
    other = replace(trial(303), name="seed 301", frames_kept=1)
    outcomes, reports = run(copied_folder, (other, TWO_TRIALS[1]))

    assert reports[0].reused_trial_count == 1
    assert outcomes["seed 301"].seed == 303
    assert len(list((copied_folder / TRIALS / "seed 301").glob("*.png"))) == 1


def test_temporary_files_of_a_killed_campaign_are_removed(copied_folder: Path) -> None:
    (copied_folder / TRIALS / ".codra-left").mkdir()
    (copied_folder / TRIALS / ".codra-left/record").write_text("half of i")
    run(copied_folder)

    assert not (copied_folder / TRIALS / ".codra-left").exists()


# Dependencies of a record


def digest(spec: Path) -> str:
    (record,) = records_of([trial(spec=spec)], Path())
    return record.digest


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """Return the laboratory's spec, in which a module of the project measures the distance."""
    shutil.copytree(SPECS, tmp_path / "project/specs")
    part = tmp_path / "project/specs/parts/machine.yaml"
    part.write_text(part.read_text().replace("codra_papers.lab.perception.functions:measure_distance", "own:measure"))
    (tmp_path / "project/pyproject.toml").write_text("[tool.codra]\n")
    (tmp_path / "project/own.py").write_text("def measure(*, machine, base, job):\n    return {}\n")
    return tmp_path / "project"


@pytest.mark.parametrize("name", ["specs/lab.yaml", "specs/parts/machine.yaml", "own.py"])
def test_a_record_depends_on_the_spec_its_parts_and_the_modules_that_it_calls(project: Path, name: str) -> None:
    before = digest(project / "specs/lab.yaml")
    with (project / name).open("a") as stream:
        stream.write("# changed\n")

    assert digest(project / "specs/lab.yaml") != before


@pytest.mark.parametrize("package", ["codra_dsl", "codra_papers"])
def test_a_record_depends_on_the_code_of_both_packages(
    package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package_folders = [tmp_path / package_folder.name for package_folder in trial_records.PACKAGE_FOLDERS]
    for package_folder in package_folders:
        package_folder.mkdir()
        (package_folder / "module.py").write_text("A = 1\n")
    monkeypatch.setattr(trial_records, "PACKAGE_FOLDERS", package_folders)
    before = trial_records.code_digest.__wrapped__()
    (tmp_path / package / "module.py").write_text("A = 2\n")

    assert trial_records.code_digest.__wrapped__() != before


def test_a_record_depends_neither_on_other_files_nor_on_the_place_of_the_project(project: Path) -> None:
    before = digest(project / "specs/lab.yaml")
    (project / "specs/notes.yaml").write_text("anything: else\n")
    moved = project.rename(project.with_name("elsewhere"))

    assert digest(moved / "specs/lab.yaml") == before


def test_a_spec_with_errors_is_not_run(project: Path) -> None:
    (project / "specs/lab.yaml").write_text("codra: 1\n")

    with pytest.raises(SpecError, match="name"):
        run(project, (trial(spec=project / "specs/lab.yaml"),))


# Refused trials and failing trials


@pytest.mark.parametrize("name", ["", ".", "..", ".hidden", "a/b", "/a", "a\nb", "a.json", "a.error", "é" * 101])
def test_a_trial_whose_name_cannot_be_that_of_a_folder_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(ValueError, match="is not a valid name for a trial"):
        run(tmp_path, (replace(trial(), name=name),))


def test_two_trials_of_one_name_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="two trials have the name 'seed 301'"):
        run(tmp_path, (trial(301), trial(301)))


def test_work_whose_description_contains_its_address_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="contains memory addresses"):
        run(tmp_path, (trial(work=wanders),))


def test_a_trial_that_raises_is_named_and_its_traceback_is_in_a_file(tmp_path: Path) -> None:
    with pytest.raises(TrialError) as error_info:
        run(tmp_path, (trial(7, Raises()),))

    assert str(error_info.value).startswith("trial 'seed 7' (seed 7): ZeroDivisionError: no robot at Mission (tests/")
    assert error_info.value.details == tmp_path / TRIALS / "seed 7.error"
    assert "Traceback" in error_info.value.details.read_text()
    assert [path.name for path in (tmp_path / TRIALS).iterdir()] == ["seed 7.error"]


def test_missing_graphics_are_reported_before_a_trial_begins(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gl, "_known_backends", [])
    monkeypatch.setenv("MUJOCO_GL", "egl")
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", "/dev/null")

    with pytest.raises(TrialError, match=r"trial 'seed 301' \(seed 301\): no OpenGL that draws without a screen"):
        run(tmp_path)


def test_a_trial_whose_process_is_killed_is_named_and_no_other_process_remains(tmp_path: Path) -> None:
    with pytest.raises(TrialError, match="its process was ended by SIGKILL"):
        run(tmp_path, (trial(7, Dies()), replace(trial(8), duration_s=None)))

    assert multiprocessing.active_children() == []
    assert list((tmp_path / TRIALS).iterdir()) == []


def test_a_trial_whose_process_exits_is_named(tmp_path: Path) -> None:
    with pytest.raises(TrialError, match="its process ended with exit code 3 and reported nothing"):
        run(tmp_path, (trial(7, Exits()),))

    assert list((tmp_path / TRIALS).iterdir()) == []


def test_a_folder_in_which_another_campaign_runs_is_left_alone(tmp_path: Path) -> None:
    def meanwhile(progress: Progress) -> None:
        with pytest.raises(CampaignBusyError, match="another program runs trials"):
            run(tmp_path)
        assert progress.done == 0
        raise InterruptedError

    with pytest.raises(InterruptedError):
        run_campaign(TWO_TRIALS, tmp_path, run=local_processes(2), progress=meanwhile)
