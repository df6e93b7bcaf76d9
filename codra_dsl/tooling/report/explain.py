"""Pages about kinds of findings.

Each page states the consequence of the finding for a robot, and shows a spec with this finding and the corrected spec.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from itertools import groupby
from pathlib import Path

from codra_dsl.language.diagnostics import Rule, Severity
from codra_dsl.language.frozen import dataclass
from codra_dsl.tooling.report.findings import as_json
from codra_dsl.workspace.suppression import known_rules

FOLDER = Path(__file__).parent / "pages"
"""The folder of the pages: `CDRnnnn.md` for each code."""

FAMILIES: Mapping[str, str] = {
    "CDR0": "Files and limits",
    "CDR002": "Settings",
    "CDR03": "Limits of trees",
    "CDR1": "YAML",
    "CDR102": "What YAML does to conditions",
    "CDR13": "XML of trees",
    "CDR2": "Shape",
    "CDR22": "FLL",
    "CDR23": "Shape of trees",
    "CDR24": "Files of knowledge graphs",
    "CDR3": "Names, parts and templates",
    "CDR31": "References and sources",
    "CDR33": "Names in trees",
    "CDR4": "Conditions and types",
    "CDR43": "Scripts of trees",
    "CDR5": "Dependencies",
    "CDR53": "Subtrees",
    "CDR6": "Output",
    "CDR7": "Context quality",
    "CDR79": "Comments that silence findings",
}
"""The families of codes by prefix. The longest matching prefix determines the family of a code."""

_INDENT = "  "


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """The page about one kind of finding.

    Attributes:
        summary: the problem, in one sentence.
        markdown: the complete page, with a heading.
    """

    code: str
    name: str
    severity: Severity
    summary: str
    markdown: str


@cache
def all_rules() -> Mapping[str, Rule]:
    """Return a mapping from codes to all rules, in the order of codes."""
    return dict(sorted(known_rules().items()))


def page_of(code: str) -> Page | None:
    """Return the page about a code, or None if there is no such page."""
    rule, file = all_rules().get(code), FOLDER / f"{code}.md"
    if rule is None or not file.is_file():
        return None
    markdown = file.read_text("utf-8")
    _, _, body, *_ = markdown.split("\n\n")
    return Page(code=code, name=rule.name, severity=rule.severity, summary=body.partition("\n")[0], markdown=markdown)


def all_pages() -> Iterator[Page]:
    """Yield every page in the order of codes."""
    yield from (page for page in map(page_of, all_rules()) if page is not None)


def code_of(name: str) -> str | None:
    """Return the code that `name` spells, or the code of the rule with this name, ignoring case; otherwise None."""
    if name.upper() in all_rules():
        return name.upper()
    return next((code for code, rule in all_rules().items() if rule.name == name.casefold()), None)


def family_of(code: str) -> str:
    """Return the family of a code, for a heading."""
    return FAMILIES[max((prefix for prefix in FAMILIES if code.startswith(prefix)), key=len)]


# ---------------------------------------------------------------------------------------------------- forms


def as_text(page: Page) -> str:
    """Return a page for a terminal: without the marks of Markdown, with indented blocks."""
    lines: list[str] = []
    is_in_block = False
    for line in page.markdown.splitlines():
        if line.startswith("```"):
            lines += _head_of_block(line) if not is_in_block else []
            is_in_block = not is_in_block
        else:
            lines.append(f"{_INDENT}{line}".rstrip() if is_in_block else _without_markdown(line))
    return "\n".join(lines) + "\n"


def _head_of_block(fence: str) -> list[str]:
    """Return the heading of a block, or nothing for the block with the spec itself."""
    file = re.search(r"file=(\S+)", fence)
    if file is not None:
        return [f"{file[1]}:"]
    return ["pyproject.toml:"] if fence == "```toml" else []


def _without_markdown(line: str) -> str:
    """Return a line of prose: headings without `#`, and backquotes as the quotes of findings."""
    return re.sub("^#+ ", "", line).replace("`", "'")


def as_json_line(page: Page) -> str:
    """Return a page as JSON in one line."""
    keys = ("code", "name", "severity", "summary", "markdown")
    return as_json({key: str(getattr(page, key)) for key in keys}) + "\n"


def list_as_text(pages: Iterable[Page]) -> str:
    """Return a list of pages for a terminal, with a heading for each family of codes."""
    families = (
        f"{family}\n"
        + "".join(f"{_INDENT}{page.code}  {page.name}: {_without_markdown(page.summary)}\n" for page in family_pages)
        for family, family_pages in groupby(pages, lambda page: family_of(page.code))
    )
    return "\n".join(families)


def list_as_markdown(pages: Iterable[Page], folder: str = "") -> str:
    """Return a list of pages as Markdown tables, one for each family. If `folder` is given, codes link to its pages."""
    families = (
        f"## {family}\n\n| code | name | severity | in one sentence |\n| --- | --- | --- | --- |\n"
        + "".join(_row(page, folder) for page in family_pages)
        for family, family_pages in groupby(pages, lambda page: family_of(page.code))
    )
    return "\n".join(families)


def _row(page: Page, folder: str) -> str:
    code = f"[{page.code}]({folder}/{page.code}.md)" if folder else page.code
    summary = page.summary.replace("|", "\\|")
    return f"| {code} | `{page.name}` | {page.severity} | {summary} |\n"
