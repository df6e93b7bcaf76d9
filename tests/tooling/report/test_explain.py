"""Pages about findings: each code has one, its bad spec has only that finding, and its good spec has none."""

from __future__ import annotations

import ast
import json
import os
import pty
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from typer.testing import CliRunner

from codra_dsl.cli.app import app
from codra_dsl.language.fuzzy import read_fll
from codra_dsl.tooling.report.explain import (
    FAMILIES,
    FOLDER,
    Page,
    all_pages,
    all_rules,
    as_text,
    family_of,
    list_as_markdown,
    page_of,
)

ROOT = Path(__file__).parents[3]
CODES = sorted(path.stem for path in FOLDER.glob("*.md"))
PAGES = list(all_pages())
FENCE = re.compile(r"^```(?P<kind>\w+)(?: file=(?P<file>\S+))?\n(?P<body>.*?)^```$", re.MULTILINE | re.DOTALL)
BAD = """\
codra: 1
name: door
context:
  bell_rings: {type: bool, source: main_execution}
skills:
  open_door: {moniter: [door_open]}
"""
FILES = {"yaml": "spec.yaml", "toml": "pyproject.toml"}
FIXES = {
    "safe": ["which `codra lint --fix` can correct", "which `codra lint --fix` can correct in some cases"],
    "suggested": ["with a fix that a person decides about"],
    None: ["without an automatic fix", "which `codra lint --fix` can correct in some cases"],
}
"""The sentences about fixes that a page may have, by the fix in its own example."""
LONGEST_SUMMARY = 120
CODE = r"CDR\d{4}"
PLACEHOLDER = "CDR0000"
"""Codes for which the settings have no unit."""


@dataclass(frozen=True)
class ReportedFinding:
    """A finding as tools read it."""

    code: str
    fix: str | None


def part(code: str, title: str) -> str:
    """Return the text below a heading of a page."""
    text = (FOLDER / f"{code}.md").read_text("utf-8")
    return text.partition(f"\n## {title}\n")[2].partition("\n## ")[0]


def sentence_on_fixes(code: str) -> str:
    """Return the sentence about fixes on a page."""
    return (FOLDER / f"{code}.md").read_text("utf-8").splitlines()[2].partition(", ")[2].removesuffix(".")


def codra(*arguments: str) -> str:
    """Run a command in this result and return its standard output."""
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code in (0, 1), (arguments, result.stderr)
    return result.stdout


def follow(text: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[ReportedFinding]:
    """Follow a part of a page in an empty folder, and return the findings of its last command."""
    folder.mkdir()
    monkeypatch.chdir(folder)
    monkeypatch.delenv("GITHUB_ACTIONS", raising=False)
    commands: list[list[str]] = []
    for block in FENCE.finditer(text):
        if block["kind"] == "python" and not block["file"]:
            subprocess.run([sys.executable, "-c", block["body"]], cwd=folder, check=True)
        elif block["kind"] == "console":
            commands = [shlex.split(line.removeprefix("$ codra ")) for line in block["body"].splitlines()]
            for command in commands[:-1]:
                codra(*command)
            if FENCE.search(text, block.end()):
                codra(*commands.pop())
        else:
            path = folder / (block["file"] or FILES[block["kind"]])
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block["body"], "utf-8")
    for engine in folder.glob("*.fll"):
        return [ReportedFinding(finding.code, None) for finding in read_fll(engine.read_bytes(), engine.name).findings]
    output = codra(*(commands[-1] if commands else ("lint", "spec.yaml")), "--format", "json")
    objects = [json.loads(line) for line in output.splitlines()]
    return [ReportedFinding(finding["code"], finding["fix"] and finding["fix"]["applicability"]) for finding in objects]


# Rules and pages


def nodes_of_files_with(word: str) -> Iterator[ast.AST]:
    """Yield the nodes of the package's files that contain a word. Parsing all files takes seconds."""
    for path in sorted((ROOT / "codra_dsl").rglob("*.py")):
        if word in (text := path.read_text("utf-8")):
            yield from ast.walk(ast.parse(text))


def declared_rules() -> Iterator[tuple[str, str]]:
    """Yield code and name of each row of each `rules(...)` in the package."""
    for node in nodes_of_files_with("rules"):
        called = getattr(node.func, "id", getattr(node.func, "attr", "")) if isinstance(node, ast.Call) else ""
        for row in node.args if isinstance(node, ast.Call) and called == "rules" else ():
            if isinstance(row, ast.Tuple):
                code, name = (ast.literal_eval(cell) for cell in row.elts[:2])
                yield code, name


def codes_in_the_source() -> Iterator[str]:
    """Yield each text of the package that is a code, for any purpose."""
    for node in nodes_of_files_with("CDR"):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and re.fullmatch(CODE, node.value):
            yield node.value


def test_every_code_of_the_package_is_known_and_has_a_page() -> None:
    written = set(codes_in_the_source()) - {PLACEHOLDER}

    assert written == set(all_rules()) == set(CODES)


def test_all_declared_rules_are_known() -> None:
    declared = list(declared_rules())

    assert [(code, rule.name) for code, rule in all_rules().items()] == sorted(declared)
    assert len({name for _, name in declared}) == len(declared)


def test_every_rule_has_a_page_and_every_page_a_rule() -> None:
    assert list(all_rules()) == CODES


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.code)
def test_a_page_has_its_shape(page: Page) -> None:
    title, severity, body, *_ = page.markdown.split("\n\n")
    headings = re.findall(r"^## (.*)$", page.markdown, re.MULTILINE)

    assert title == f"# {page.code} {page.name}"
    assert severity in {
        f"{page.severity.value.capitalize()}, {sentence}." for sentences in FIXES.values() for sentence in sentences
    }
    assert headings in (["Bad", "Good"], ["Bad", "Good", "How to decide"])
    assert 1 <= len(body.splitlines()) <= 4
    assert len(part(page.code, "How to decide").strip().splitlines()) <= 4
    assert page.markdown == f"{page.markdown.rstrip()}\n"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.code)
def test_a_summary_is_one_short_sentence(page: Page) -> None:
    assert re.fullmatch(r"[A-Z'`$].*[^.]\.", page.summary)
    assert not re.search(r"[.!?] [A-Z]", page.summary)
    assert len(page.summary) < LONGEST_SUMMARY


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.code)
def test_no_page_names_a_path_of_a_machine(page: Page) -> None:
    assert not re.search(r"/(?:work|home|root|tmp|Users)/|[A-Z]:\\", page.markdown)


def test_there_is_no_page_about_an_unknown_code() -> None:
    assert page_of("CDR9999") is None
    assert page_of("../pages/CDR2003") is None


# Examples


@pytest.mark.parametrize("code", CODES)
def test_the_bad_spec_has_this_finding_and_no_other(code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    findings = follow(part(code, "Bad"), tmp_path / "bad", monkeypatch)
    (only_finding,) = findings

    assert only_finding.code == code
    assert sentence_on_fixes(code) in FIXES[only_finding.fix]


@pytest.mark.parametrize("code", CODES)
def test_the_good_spec_has_no_finding(code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    findings = follow(part(code, "Good"), tmp_path / "good", monkeypatch)

    assert findings == []


@pytest.mark.parametrize("code", [code for code in CODES if sentence_on_fixes(code) == FIXES["safe"][0]])
def test_the_fix_makes_the_good_spec_of_the_bad_one(code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    follow(part(code, "Bad"), tmp_path / "bad", monkeypatch)
    codra("lint", "spec.yaml", "--fix")
    fixed = Path("spec.yaml").read_text("utf-8")
    follow(part(code, "Good"), tmp_path / "good", monkeypatch)

    assert fixed == Path("spec.yaml").read_text("utf-8")


def test_no_page_denies_a_safe_fix_that_a_case_has(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT / "tests/cases/invalid")
    output = codra("lint", *sorted(path.name for path in Path().glob("*.yaml")), "--format", "json")
    fixed = {finding["code"] for finding in map(json.loads, output.splitlines()) if finding["fix"]}

    assert "CDR2003" in fixed
    assert [code for code in sorted(fixed) if sentence_on_fixes(code) not in FIXES["safe"] + FIXES["suggested"]] == []


# Lists


def test_the_reference_lists_every_finding(renew_cases: bool) -> None:
    reference = ROOT / "docs/reference/findings.md"
    introduction = reference.read_text("utf-8").partition("\n## ")[0]
    listed = list_as_markdown(PAGES, "../../codra_dsl/tooling/report/pages")
    if renew_cases:
        reference.write_text(f"{introduction.rstrip()}\n\n{listed}", "utf-8")

    assert reference.read_text("utf-8") == f"{introduction.rstrip()}\n\n{listed}"
    assert all((reference.parent / link).is_file() for link in re.findall(r"\]\((\S+CDR\d{4}\.md)\)", listed))
    assert listed.count("](") == len(all_rules())


def test_every_family_of_codes_has_a_member() -> None:
    assert {family_of(code) for code in all_rules()} == set(FAMILIES.values())


# The command


def test_explain_takes_codes_and_names_in_any_letters_and_shows_no_page_twice() -> None:
    first, second = (page for page in PAGES if page.code in ("CDR2003", "CDR5101"))

    assert codra("explain", "cdr2003", "Cycle", "unknown-key") == f"{as_text(first)}\n{as_text(second)}"
    assert codra("explain", "UNKNOWN-KEY", "--format", "markdown") == first.markdown


def test_a_page_as_text_has_no_marks_of_markdown() -> None:
    text = codra("explain", "CDR3010")

    assert text.startswith("CDR3010 part-not-found\n\nError, without an automatic fix.\n")
    assert "\nparts/camera.yaml:\n  codra: 1\n" in text
    assert not re.search(r"^#|`", text, re.MULTILINE)


def test_explain_without_a_code_lists_all() -> None:
    text, table = codra("explain"), codra("explain", "--format", "markdown")
    objects = [json.loads(line) for line in codra("explain", "--format", "json").splitlines()]

    assert all(f"  {page.code}  {page.name}: " in text for page in PAGES)
    assert table == list_as_markdown(PAGES)
    assert [(page_object["code"], page_object["severity"], page_object["markdown"]) for page_object in objects] == [
        (page.code, page.severity.value, page.markdown) for page in PAGES
    ]


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ("unknwon-key", "there is no finding 'unknwon-key': did you mean CDR2003 (unknown-key)?"),
        ("CDR203", "there is no finding 'CDR203': did you mean CDR2003 (unknown-key)?"),
        ("colour", "there is no finding 'colour': 'codra explain' lists all findings"),
        ("\x1b[31m", "there is no finding '\N{REPLACEMENT CHARACTER}[31m': 'codra explain' lists all findings"),
    ],
)
def test_an_unknown_code_is_a_usage_error_with_a_suggestion(asked: str, message: str) -> None:
    result = CliRunner().invoke(app, ["explain", "CDR2003", asked])

    assert result.exit_code == 2
    assert result.stdout == ""
    assert message in result.stderr


def test_findings_on_a_terminal_end_with_a_pointer_to_a_page_and_nowhere_else(tmp_path: Path) -> None:
    (tmp_path / "door.yaml").write_text(BAD, "utf-8")
    command = [sys.executable, "-m", "codra_dsl", "lint", "door.yaml"]

    assert seen_on_a_terminal([*command], tmp_path).endswith("to learn more: codra explain CDR2003\r\n")
    assert "codra explain" not in seen_on_a_terminal([*command, "--format", "concise"], tmp_path)
    piped = subprocess.run(command, cwd=tmp_path, env=environment(), capture_output=True, text=True, check=False)
    assert "codra explain" not in piped.stdout + piped.stderr


def seen_on_a_terminal(command: list[str], folder: Path) -> str:
    """Run a command whose standard error is a terminal and return the text that it shows there."""
    ours, theirs = pty.openpty()
    subprocess.run(command, cwd=folder, env=environment(), stdout=subprocess.DEVNULL, stderr=theirs, check=False)
    os.close(theirs)
    shown = os.read(ours, 1 << 16).decode()
    os.close(ours)
    return shown


def environment() -> dict[str, str]:
    """Return the environment without variables that change how findings are shown."""
    kept = {name: value for name, value in os.environ.items() if name != "GITHUB_ACTIONS"}
    return {**kept, "PYTHONPATH": str(ROOT)}
