"""Findings with hostile texts, which contain markup, commands, or invalid characters."""

from __future__ import annotations

from pathlib import Path

from hypothesis import strategies as st

from codra_dsl.language.check import check
from codra_dsl.language.diagnostics import (
    Applicability,
    Diagnostic,
    Edit,
    Fix,
    Place,
    Related,
    Rule,
    Severity,
    Span,
    in_file_order,
)
from codra_dsl.language.load import load_spec

CASES = sorted(
    path
    for path in (Path(__file__).parents[2] / "cases" / "invalid").iterdir()
    if path.is_dir() or path.suffix == ".yaml"
)

RULES = [
    Rule(code="CDR2003", name="unknown-key", severity=Severity.ERROR),
    Rule(code="CDR5101", name="cycle", severity=Severity.ERROR),
    Rule(code="CDR7102", name="unreached-variable", severity=Severity.WARNING),
]

ATTACKS = [
    *("::error::x", "::stop-commands::x", "##[error]x", "##[add-mask]a", "]]>", "</failure>", "<!--", "&amp;"),
    *("%0A::error::x", "%25", "](https://example.org)", "[x](1)", "| a |", "`", "\x1b[31m", "\n::error::x\n", "\r"),
    *("\ud800", "\udcff", "\x00", "\ufffe", "\u202e", "\t", "{0}", "\\", ",col=1", ":", "戸", "\U0001f916"),
]

texts = st.lists(st.one_of(st.sampled_from(ATTACKS), st.text(st.characters(), max_size=4)), max_size=4).map("".join)
files = st.one_of(st.sampled_from(["specs/door.yaml", "-", "::error::x.yaml"]), texts.filter(bool))


@st.composite
def spans(draw: st.DrawFn) -> Span:
    line, column = draw(st.integers(1, 99)), draw(st.integers(1, 99))
    rows = draw(st.sampled_from([0, 0, 3]))
    return Span(draw(files), line, column, line + rows, column + draw(st.integers(0, 9)))


places = st.builds(Place, spans(), st.one_of(st.none(), spans()))
fixes = st.builds(
    Fix,
    message=texts,
    edits=st.lists(st.builds(Edit, spans(), texts), min_size=1, max_size=3).map(tuple),
    applicability=st.sampled_from(Applicability),
)
hostile_findings = st.lists(
    st.builds(
        Diagnostic,
        rule=st.sampled_from(RULES),
        message=texts,
        place=places,
        path=texts,
        help=texts,
        related=st.lists(st.builds(Related, texts, places), max_size=2).map(tuple),
        fix=st.one_of(st.none(), fixes),
    ),
    max_size=4,
)


def findings_about(spec: Path, root: Path) -> tuple[Diagnostic, ...]:
    """Return the findings of load and check about a spec."""
    loaded_spec, load_findings = load_spec(spec, root)
    return in_file_order(load_findings + (check(loaded_spec)[1] if loaded_spec is not None else ()))


def findings_of(case: Path) -> tuple[Diagnostic, ...]:
    """Return the findings of load and check about one of the invalid cases."""
    return findings_about(case / "spec.yaml", case) if case.is_dir() else findings_about(case, case.parent)
