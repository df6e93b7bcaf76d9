"""Convert findings to data and back. Data is validated when it is read, because a cache file may contain anything."""

from __future__ import annotations

from typing import Any

from codra_dsl.language.diagnostics import Applicability, Diagnostic, Edit, Fix, Place, Related, Rule, Severity, Span
from codra_dsl.language.file_queries import Answers, is_query


def record_of(diagnostic: Diagnostic) -> dict[str, object]:
    """Return a finding as plain data."""
    return {
        "rule": [diagnostic.rule.code, diagnostic.rule.name, diagnostic.rule.severity],
        "message": diagnostic.message,
        "place": place_record(diagnostic.place),
        "path": diagnostic.path,
        "help": diagnostic.help,
        "related": [[related.message, place_record(related.place)] for related in diagnostic.related],
        "fix": None if diagnostic.fix is None else _fix_record(diagnostic.fix),
        "level": diagnostic.level,
        "each_use": [record_of(use) for use in diagnostic.use_findings],
    }


def finding_from(record: Any) -> Diagnostic:
    """Return a finding from plain data.

    Raises:
        TypeError, ValueError, LookupError: if the data does not describe a finding.
    """
    code, name, severity = texts_from(record["rule"])
    level = record["level"]
    return Diagnostic(
        rule=Rule(code=code, name=name, severity=Severity(severity)),
        message=text_from(record["message"]),
        place=place_from(record["place"]),
        path=text_from(record["path"]),
        help=text_from(record["help"]),
        related=tuple(Related(text_from(message), place_from(place)) for message, place in record["related"]),
        fix=None if record["fix"] is None else _fix_from(record["fix"]),
        level=None if level is None else Severity(text_from(level)),
        use_findings=tuple(map(finding_from, record["each_use"])),
    )


def text_from(value: object) -> str:
    """Return a value that must be a string."""
    if not isinstance(value, str):
        raise TypeError
    return value


def texts_from(values: object) -> tuple[str, ...]:
    """Return values that must be a list of strings."""
    if not isinstance(values, list):
        raise TypeError
    return tuple(map(text_from, values))


def record_of_answers(answers: Answers) -> list[list[str | int]]:
    """Return queries with their answers as plain data."""
    return [[*query, answer] for query, answer in answers.items()]


def answers_from(record: Any) -> Answers:
    """Return queries with their answers from plain data.

    Raises:
        TypeError, ValueError: if the data does not describe queries with answers.
    """
    answers = {tuple(query): text_from(answer) for *query, answer in record}
    if not all(map(is_query, answers)):
        raise TypeError
    return answers


def place_record(place: Place) -> list[object]:
    """Return a place as plain data."""
    return [_span_record(place.span), None if place.use is None else _span_record(place.use)]


def place_from(record: Any) -> Place:
    """Return a place from plain data.

    Raises:
        TypeError, ValueError: if the data does not describe a place.
    """
    span, use = record
    return Place(_span_from(span), None if use is None else _span_from(use))


def _span_record(span: Span) -> list[object]:
    return [span.file, span.line, span.column, span.end_line, span.end_column]


def _span_from(record: Any) -> Span:
    file, *lines_and_columns = record
    line, column, end_line, end_column = lines_and_columns
    if any(type(number) is not int or number < 1 for number in lines_and_columns):
        raise TypeError
    return Span(text_from(file), line, column, end_line, end_column)


def _fix_record(fix: Fix) -> dict[str, object]:
    edits = [[_span_record(edit.span), edit.text] for edit in fix.edits]
    return {"message": fix.message, "edits": edits, "applicability": fix.applicability}


def _fix_from(record: Any) -> Fix:
    return Fix(
        message=text_from(record["message"]),
        edits=tuple(Edit(_span_from(span), text_from(text)) for span, text in record["edits"]),
        applicability=Applicability(text_from(record["applicability"])),
    )
