"""Every code block of README and docs runs, page by page, in a separate folder, as a reader would follow it.

The info string of a block states its use: `yaml file=PATH`, `python file=PATH` and all other blocks with `file` are
written to that file, `python` runs, `console` runs each line after `$ ` and shows exactly the printed output
(`console exit=1` if it fails), `text` and `mermaid` are for reading only. A block with `in=rafcon` runs in the
environment that has RAFCON.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from codra_dsl.language.check.index.rules import RULES
from tests.command_server import run_python

ROOT = Path(__file__).parent.parent
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])
HERE = Path(sys.executable)
"""The Python of this environment, whose commands run in processes that are forked."""

PYTHON_ARGUMENTS = {"codra": ("-m", "codra_dsl"), "pytest": ("-m", "pytest"), "python": ()}
"""The arguments of Python that run a command of this environment."""

RAFCON_PYTHON = ROOT / ".venv-rafcon/bin/python"
FENCE = re.compile(r"^```(?P<info>[^\n`]*)\n(?P<body>.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\((?!\w+:)(?P<path>[^)\s#]*)(?:#(?P<anchor>[^)\s]+))?\)")
HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)
RULE_ROW = re.compile(r"^\| (CDR\d+) \| `([\w-]+)`", re.MULTILINE)
RULE_ENTRY = re.compile(r"^\*\*(CDR\d+) `([\w-]+)`\.\*\*$(?:(?!^\*\*CDR|^## ).)+?^\*Help:\* ", re.MULTILINE | re.DOTALL)
KINDS = {"yaml", "python", "console", "text", "json", "toml", "sh", "xml", "lua", "mermaid", "cpp"}


@dataclass(frozen=True)
class Block:
    """A fenced block of a page."""

    kind: str
    options: dict[str, str]
    body: str


def blocks(page: Path) -> Iterator[Block]:
    """Yield the blocks of a page, in order."""
    for match in FENCE.finditer(page.read_text(encoding="utf-8")):
        kind, *options = match["info"].split()
        yield Block(kind, dict(option.split("=", 1) for option in options), match["body"])


def python_of(block: Block) -> Path:
    """Return the Python that a block runs in."""
    python = {"": HERE, "rafcon": RAFCON_PYTHON}[block.options.get("in", "")]
    assert python.exists(), f"{python} is not there: `make rafcon` sets it up"
    return python


def run(command: list[str], folder: Path, python: Path = HERE) -> tuple[int, str]:
    """Run a command of a page in its folder; return its exit code and its output."""
    search_path = os.pathsep.join(filter(None, (str(folder), os.environ.get("PYTHONPATH"))))
    environment = os.environ | {"PYTHONPATH": search_path, "NO_COLOR": "1", "COLUMNS": "120"}
    environment["XDG_STATE_HOME"] = str(folder / ".state")
    environment["PATH"] = f"{python.parent}{os.pathsep}{environment['PATH']}"
    for name in ("GITHUB_ACTIONS", "PYTEST_ADDOPTS"):  # settings of this run do not apply to those commands
        environment.pop(name, None)
    if python == HERE and command[0] in PYTHON_ARGUMENTS:
        arguments = (*PYTHON_ARGUMENTS[command[0]], *command[1:])
        forked = run_python(arguments, folder, environment, is_output_merged=True)
        return forked.returncode, forked.stdout.decode()
    process = subprocess.run(
        command, cwd=folder, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False
    )
    return process.returncode, process.stdout


def run_console(block: Block, folder: Path) -> None:
    """Run a block's commands and compare their output."""
    for part in re.split(r"^\$ ", block.body, flags=re.MULTILINE)[1:]:
        command, _, expected = part.partition("\n")
        exit_code, output = run(shlex.split(command), folder, python_of(block))

        assert output.strip() == expected.strip(), command
        assert exit_code == int(block.options.get("exit", "0")), output


def follow(block: Block, folder: Path) -> None:
    """Follow a block as a reader does."""
    if "file" in block.options:
        path = folder / block.options["file"]
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(block.body, encoding="utf-8")
    elif block.kind == "console":
        run_console(block, folder)
    elif block.kind == "python":
        exit_code, output = run(["python", "-W", "error", "-c", block.body], folder, python_of(block))

        assert exit_code == 0, output


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_block_of_a_page_does_what_the_page_states(page: Path, tmp_path: Path) -> None:
    page_blocks = list(blocks(page))

    assert all(block.kind in KINDS for block in page_blocks), "an unknown kind of block would not be run"
    for block in page_blocks:
        follow(block, tmp_path)


def prose(page: Path) -> str:
    """Return a page without its blocks and without code in its lines."""
    return re.sub(r"`[^`\n]*`", "", FENCE.sub("", page.read_text(encoding="utf-8")))


def anchors(page: Path) -> set[str]:
    """Return the anchors that repository browsers and the site give to the headings of a page."""
    headings = HEADING.findall(FENCE.sub("", page.read_text(encoding="utf-8")))
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", [*ROOT.glob("*.md"), *PAGES[1:]], ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_of_a_page_leads_to_a_file_and_to_a_heading(page: Path) -> None:
    dead_links = [
        link[0]
        for link in LINK.finditer(prose(page))
        for target in [page.parent / link["path"] if link["path"] else page]
        if not target.exists() or (link["anchor"] and link["anchor"] not in anchors(target))
    ]

    assert dead_links == []


def test_every_rule_of_context_quality_has_a_row_and_an_entry_with_help() -> None:
    page = (ROOT / "docs/reference/context-quality.md").read_text(encoding="utf-8")
    ranges = (("CDR7101", "CDR7120"), ("CDR7141", "CDR7145"))
    rules = [
        (rule.code, rule.name) for rule in RULES.values() if any(first <= rule.code <= last for first, last in ranges)
    ]

    assert RULE_ROW.findall(page) == [("CDR5102", "never-runs"), *rules]
    assert sorted(RULE_ENTRY.findall(page)) == [("CDR5102", "never-runs"), *rules]
