"""`codra explain`: the meaning of a finding, with a spec that causes the finding, and this spec after correction."""

from __future__ import annotations

from collections.abc import Iterator
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.console import write_result

if TYPE_CHECKING:
    from codra_dsl.tooling.report.explain import Page


class PageFormat(StrEnum):
    """The formats of pages."""

    TEXT = "text"
    MARKDOWN = "markdown"
    JSON = "json"


def complete_code(incomplete: str) -> list[tuple[str, str]]:
    """Return the codes that begin with a text, each with the name of its finding; and the names that do."""
    from codra_dsl.tooling.report.explain import all_rules

    codes = [(code, rule.name) for code, rule in all_rules().items() if code.startswith(incomplete)]
    names = [(rule.name, code) for code, rule in all_rules().items() if rule.name.startswith(incomplete)]
    return [*codes, *names] if incomplete else codes


Codes = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="CODE",
        help="Codes or names of findings, e.g. CDR2003 or unknown-key.  [default: list all findings]",
        autocompletion=complete_code,
    ),
]


def explain_command(
    codes: Codes = None,
    *,
    format_: Annotated[PageFormat, typer.Option("--format", help="How pages are shown.")] = PageFormat.TEXT,
) -> None:
    """Explain a finding, with an example and its correction."""
    from codra_dsl.tooling.report.explain import all_pages, as_json_line, as_text, list_as_markdown, list_as_text

    pages = list(_requested_pages(codes) if codes else all_pages())
    match format_:
        case PageFormat.JSON:
            text = "".join(map(as_json_line, pages))
        case PageFormat.MARKDOWN:
            text = "\n".join(page.markdown for page in pages) if codes else list_as_markdown(pages)
        case PageFormat.TEXT:
            text = "\n".join(map(as_text, pages)) if codes else list_as_text(pages)
    write_result(text)


def _requested_pages(codes_or_names: list[str]) -> Iterator[Page]:
    """Yield the requested pages without duplicates. An unknown code or name is a usage error."""
    from codra_dsl.tooling.report.explain import all_rules, code_of, page_of
    from codra_dsl.tooling.report.findings import visible_text
    from codra_dsl.workspace.suppression.rules import nearest_code

    for code in dict.fromkeys(code_of(code_or_name) or code_or_name for code_or_name in codes_or_names):
        page = page_of(code)
        if page is None:
            similar_code = nearest_code(code)
            hint = (
                f"did you mean {similar_code} ({all_rules()[similar_code].name})?"
                if similar_code
                else "'codra explain' lists all findings"
            )
            raise typer.BadParameter(f"there is no finding '{visible_text(code)}': {hint}", param_hint="CODE")
        yield page
