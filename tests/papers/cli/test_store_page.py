"""The picker's page in Chromium, with a real `codra run`: clicks reach the journal of the process."""

from __future__ import annotations

import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect, sync_playwright

from tests.cli.test_commands import ROOT, codra, environment

STORE = str(ROOT / "specs/store.yaml")
TIMEOUT_S = 60.0
expect.set_options(timeout=1000 * TIMEOUT_S)
LOAD_NEVER_KNOWN = (
    "an input of the loop 'mission' was never known: 'container_load' was not known during 30 s: never_observed\n"
)
HEIGHTS = "all => all.map(each => each.getBoundingClientRect().height)"


def _heed_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)


class Run:
    """A `codra run` with a page."""

    def __init__(self, folder: Path, *options: str, spec: str = STORE) -> None:
        self.folder = folder
        self.journal = folder / "run.mcap"
        settings = ("--world", "store", "--page", "--journal", str(self.journal), *options)
        self.process = subprocess.Popen(
            [sys.executable, "-m", "codra_dsl", "run", spec, *settings],
            cwd=folder,
            env=environment(),
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            preexec_fn=_heed_interrupts,  # a shell makes jobs in the background ignore them  # noqa: PLW1509
        )
        assert self.process.stderr is not None
        line = self.process.stderr.readline()
        match = re.fullmatch(r"the picker's page is at (http://127\.0\.0\.1:\d+/)\n", line)
        assert match, line
        self.url = match[1]

    def events(self, *options: str) -> str:
        """Return the events in the journal so far. The process still writes the journal."""
        assert self.process.poll() is None
        return codra("journal", "show", str(self.journal), *options, cwd=self.folder).stdout

    def interrupt(self) -> tuple[int, str, str]:
        self.process.send_signal(signal.SIGINT)
        try:
            output, errors = self.process.communicate(timeout=TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self.kill()
            raise
        return self.process.returncode, output, errors

    def kill(self) -> None:
        self.process.kill()
        self.process.communicate()


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    """Return a run that several tests use, so that earlier orders may be in it."""
    started_run = Run(tmp_path_factory.mktemp("run"), "--pace", "real")
    yield started_run
    started_run.kill()


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    chromium = shutil.which("chromium")
    assert chromium, "README.md has the line that installs it"
    with sync_playwright() as playwright:
        launched_browser = playwright.chromium.launch(executable_path=chromium)
        yield launched_browser
        launched_browser.close()


@pytest.fixture(autouse=True)
def _closed_pages(browser: Browser) -> Iterator[None]:
    """Close the pages of a test after it, because a page of a run that goes on is drawn again and again."""
    yield
    for context in browser.contexts:
        context.close()


def copied_spec(folder: Path) -> Path:
    """Return a copy of the store's spec in a folder that also has the behavior trees."""
    shutil.copytree(ROOT / "specs/trees", folder / "trees")
    return Path(shutil.copy(ROOT / "specs/store.yaml", folder))


def open_page(browser: Browser, run: Run, **settings: Any) -> Page:
    """Return the page as soon as it shows the robot's knowledge."""
    page = browser.new_page(**settings)
    page.goto(run.url)
    expect(page.locator("#connection")).to_have_text("Live.")
    return page


def click_to_order(page: Page, button: str) -> int:
    """Order by a click, and return the number of the order."""
    page.get_by_role("button", name=button).click()
    answer = page.locator("#answer")
    expect(answer).to_have_text(re.compile(r"Order \d+ is in the robot's knowledge\."))
    return int(re.sub(r"\D", "", answer.inner_text()))


def test_a_container_is_requested_by_a_click_and_the_robot_starts(browser: Browser, run: Run) -> None:
    page = open_page(browser, run)
    page.locator("#provide").get_by_label("To").select_option("Area 3")
    number = click_to_order(page, "Request a container")
    orders, navigating = page.locator("#orders"), page.locator("#tasks tr").filter(has_text="Navigating")
    expect(orders).to_contain_text(f"Order {number}: provideSupplyArea 3open")
    expect(navigating).to_contain_text("under way for mission")

    events = run.events("--kind", "knowledge")

    assert re.search(rf"order_{number} node_inserted .*\"agent\":\"picker_page\"", events)
    assert re.search(rf"order_{number}\.kind written .*\"agent\":\"picker_page\".*\"value\":\"provide\"", events)
    assert f"order_{number} -of_area-> supply edge_inserted" in events
    assert f"order_{number} -to_area-> area_3 edge_inserted" in events
    assert re.search(r"navigating wants .*\"agent\":\"mission\"", events)


def test_the_page_is_the_same_if_the_agents_are_processes(browser: Browser, tmp_path: Path) -> None:
    run = Run(tmp_path, "--processes")
    try:
        page = open_page(browser, run)
        number = click_to_order(page, "Request a container")
        expect(page.locator("#orders")).to_contain_text(f"Order {number}: provideSupply")
        navigating = page.locator("#tasks tr").filter(has_text="Navigating")
        expect(navigating).to_contain_text("under way for mission")
        page.close()
        exit_code, output, errors = run.interrupt()
    finally:
        run.kill()

    assert (exit_code, output) == (130, "")
    assert "Traceback" not in errors


def test_delivery_is_asked_for_and_the_order_is_taken_back_by_clicks(browser: Browser, run: Run) -> None:
    page = open_page(browser, run)
    number = click_to_order(page, "Ask for delivery")
    page.get_by_role("button", name=f"Take back order {number}").click()
    order = page.locator("#orders > *").filter(has_text=f"Order {number}")
    expect(order).to_contain_text("cancelled")

    events = run.events("--kind", "knowledge")

    assert f"order_{number} -to_area-> delivery edge_inserted" in events
    assert re.search(rf"order_{number}\.cancelled written .*\"agent\":\"picker_page\"", events)
    assert re.search(rf"order_{number}\.state written .*\"agent\":\"mission\".*\"value\":\"cancelled\"", events)


def test_a_container_is_marked_full_with_the_keyboard_and_every_browser_sees_it(browser: Browser, run: Run) -> None:
    page, other_page = open_page(browser, run), open_page(browser, run, viewport={"width": 390, "height": 844})
    full_button = page.get_by_role("button", name="Full")
    full_button.focus()
    page.keyboard.press("Enter")

    expect(page.locator("#answer")).to_have_text("The container is marked full.")
    for shown_page in (page, other_page):
        expect(shown_page.get_by_role("button", name="Full")).to_have_attribute("aria-pressed", "true")
    expect(full_button).to_be_focused()
    assert re.search(
        r"variable container_load identified .*\"value\":\"full\".*\"source\":\"picker_page\"", run.events()
    )


def test_missing_parts_of_a_run_are_named_on_the_page(browser: Browser, tmp_path: Path) -> None:
    spec = copied_spec(tmp_path)
    spec.write_text(spec.read_text("utf-8").partition("\nmetrics:\n")[0], "utf-8")
    run = Run(tmp_path, "--pace", "real", spec=spec.name)
    try:
        page = open_page(browser, run)

        expect(page.locator("#no-metrics")).to_have_text("No agent of this run computes metrics.")
        expect(page.locator("#parameters")).to_have_text("Maximum speedunknown (never observed)")
        expect(page.locator("#no-orders")).to_be_visible()
        expect(page.locator("#map-text")).to_contain_text("Robot (blue) at 8.2 m east, 2.0 m north")
    finally:
        run.kill()


def test_a_refused_click_names_the_agent_with_the_permission(browser: Browser, tmp_path: Path) -> None:
    spec = copied_spec(tmp_path)
    page_text, fork_text = (f"values: [empty, loading, full], source: {agent}" for agent in ("picker_page", "fork"))
    spec.write_text(spec.read_text("utf-8").replace(page_text, fork_text), "utf-8")
    run = Run(tmp_path, "--pace", "real", spec="store.yaml")
    reason = "'robot.container_load' may be written by fork, not by 'picker_page'"
    try:
        page = open_page(browser, run)
        page.get_by_role("button", name="Full").click()
        expect(page.locator("#problem")).to_have_text(f"Refused (picker_page): {reason}")
        expect(page.locator("#refusals")).to_contain_text(f"picker_page: {reason}")
        events = run.events("--kind", "knowledge", "--what", "refused")
    finally:
        run.kill()

    assert "robot.container_load refused" in events
    assert "may be written by fork" in events


def test_the_page_fits_any_screen_and_all_controls_have_names(browser: Browser, run: Run) -> None:
    page = open_page(browser, run)
    for width in (320, 390, 1024, 1400):
        page.set_viewport_size({"width": width, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth") == width
        heights = page.locator("button:not(.take-back), select").evaluate_all(HEIGHTS)
        heights_of_take_back = page.locator(".take-back").evaluate_all(HEIGHTS)
        assert min(heights + heights_of_take_back) >= 44, "large enough for a thumb"

    unlabelled_count = page.locator("select").evaluate_all("all => all.filter(each => each.labels.length === 0).length")
    assert (len(heights), unlabelled_count) == (8, 0)


def test_an_interrupted_run_leaves_a_complete_journal_and_a_page_that_shows_that_it_is_outdated(
    browser: Browser, tmp_path: Path
) -> None:
    run = Run(tmp_path, "--pace", "fast")
    page = open_page(browser, run)
    click_to_order(page, "Request a container")
    expect(page.locator("#orders")).to_contain_text("Order 1")  # on a slow machine, the order has ended already
    exit_code, output, errors = run.interrupt()
    assert (exit_code, output) == (130, "")
    assert errors.replace(LOAD_NEVER_KNOWN, "") == ""  # how much time has passed depends on the machine

    expect(page.locator("#connection")).to_have_text("No connection: the values shown are old. Trying again …")
    page.get_by_role("button", name="Full").click()
    expect(page.locator("#problem")).to_have_text("Not done: the robot's program does not answer.")
    completed_process = codra("replay", str(run.journal), "--package", f"{ROOT}/generated/store", cwd=tmp_path)
    assert (completed_process.returncode, completed_process.stdout.split(":")[0]) == (0, "equal")


def test_a_port_in_use_is_reported(run: Run, tmp_path: Path) -> None:
    port = run.url.rstrip("/").rpartition(":")[2]

    completed_process = codra("run", STORE, "--world", "store", "--page", "--port", port, cwd=tmp_path)

    assert (completed_process.returncode, completed_process.stdout) == (1, "")
    assert completed_process.stderr == f"codra: the page cannot be served at port {port}: Address already in use\n"


# Without a page


def test_a_run_in_the_store_prints_its_result(tmp_path: Path) -> None:
    situation = ("--situation", "hidden", "--seed", "6", "--for", "5 s")
    completed_process = codra("run", STORE, "--world", "store", *situation, cwd=tmp_path)

    assert completed_process.returncode == 0, completed_process.stderr
    assert completed_process.stdout.startswith(
        "5.0 s\norders              1 open\nmissions completed  0 (no container was set down)\n"
    )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--world", "store", "--naive"), "the world 'store' has no such option"),
        (("--world", "lab", "--page"), "the world 'lab' has no such option"),
        (("--world", "store", "--port", "8000"), "this is the port of the page"),
    ],
)
def test_options_of_another_world_are_refused(options: tuple[str, ...], message: str, tmp_path: Path) -> None:
    completed_process = codra("run", STORE, *options, cwd=tmp_path)

    assert completed_process.returncode == 2
    assert message in completed_process.stderr


def test_a_spec_without_the_needs_of_the_store_is_refused(tmp_path: Path) -> None:
    completed_process = codra("run", str(ROOT / "specs/kitchen.yaml"), "--world", "store", cwd=tmp_path)

    assert (completed_process.returncode, completed_process.stdout) == (1, "")
    assert completed_process.stderr.startswith("codra: 'kitchen' does not run in the store: ")


def test_a_tree_with_an_action_that_the_truck_lacks_is_reported(tmp_path: Path) -> None:
    for file in (copied_spec(tmp_path), tmp_path / "trees/mission.xml"):
        file.write_text(file.read_text("utf-8").replace("LowerFork", "DropLoad"), "utf-8")
    completed_process = codra("run", "store.yaml", "--world", "store", cwd=tmp_path)

    assert (completed_process.returncode, completed_process.stdout) == (1, "")
    assert completed_process.stderr.startswith(
        "codra: 'store' does not run in the store: the robot has no action 'DropLoad'"
    )
