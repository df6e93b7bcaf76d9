"""Rename a name everywhere, if the specs have the same findings afterwards."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

from codra_dsl.language.diagnostics import Diagnostic, Edit
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.yaml.names import is_identifier
from codra_dsl.tooling.language_server.documents import Document
from codra_dsl.tooling.language_server.index import Cursor, Range, SpecNames, Symbol
from codra_dsl.tooling.language_server.projects import Project


class RefusedError(Exception):
    """A name cannot be changed. The message states the reason."""


def renameable(cursor: Cursor) -> Range:
    """Return the name at the cursor.

    Raises:
        RefusedError: if there is no name, or if it cannot be changed.
    """
    found = [name_range for _, name_range in cursor.index.at(cursor)]
    names = sorted({name_range.symbol.name for name_range in found})
    if not found:
        raise RefusedError("there is no name here, or the text around it cannot be read at the moment")
    if found[0].symbol.section == "spec":
        raise RefusedError("the name of a spec is also the name of its generated package, which programs import")
    if not found[0].is_written:
        written = shown(cursor.document.text[found[0].start : found[0].end])
        raise RefusedError(f"a template makes {' and '.join(names)} from {written}")
    return found[0]


def rename(project: Project, cursor: Cursor, new_name: str) -> Sequence[Edit]:
    """Return the edits that rename the name at the cursor.

    The newest texts of the project must have been linted.

    Raises:
        RefusedError: if the name cannot be changed, or if the change would cause a finding.
    """
    renameable(cursor)
    if not is_identifier(new_name):
        is_reserved = is_identifier(f"{new_name}_")
        reason = "is reserved" if is_reserved else "is not a name: use letters A to Z, digits and '_', a letter first"
        raise RefusedError(f"{shown(new_name)} {reason}")
    index = cursor.index
    symbols = index.symbols(cursor)
    ranges = index.ranges(symbols, project.other_files())
    if not all(index.is_current(names) for names, _ in symbols):
        raise RefusedError("the text cannot be read at the moment, so some uses of the name are not known")
    _refuse_made_names(cursor, ranges)
    _refuse_taken_name(symbols, new_name)
    texts = {
        file: _replaced(index.texts.document(file), file, ranges, new_name) for file in {one.file for one in ranges}
    }
    finding = _first_new(project.checked.diagnostics, project.findings_with(texts))
    if finding is not None:
        span = finding.place.span
        raise RefusedError(f"'{new_name}' would cause {finding.code} at {span.file}:{span.line}: {finding.message}")
    return [Edit(index.texts.document(one.file).span(one.file, one.start, one.end), new_name) for one in ranges]


def _refuse_made_names(cursor: Cursor, ranges: Sequence[Range]) -> None:
    if not any(name_range.is_declaration for name_range in ranges):
        raise RefusedError("this name is not declared in a spec")
    for symbol, file, start, end, _, is_written in ranges:
        if not is_written:
            document = cursor.index.texts.document(file)
            line = document.position_at(start).line + 1
            raise RefusedError(f"'{symbol.name}' is made from {shown(document.text[start:end])} at {file}:{line}")


def _refuse_taken_name(symbols: Iterable[tuple[SpecNames, Symbol]], new_name: str) -> None:
    for names, symbol in symbols:
        for other, place in names.declarations.items():
            if other != symbol and other._replace(name=other.name.casefold()) == symbol._replace(
                name=new_name.casefold()
            ):
                raise RefusedError(f"'{other.name}' is taken: see {place.span.file}:{place.span.line}")


def _replaced(document: Document, file: str, ranges: Iterable[Range], new_name: str) -> Document:
    pieces: list[str] = []
    position = 0
    for name_range in ranges:
        if name_range.file == file:
            pieces += [document.text[position : name_range.start], new_name]
            position = name_range.end
    return Document("".join([*pieces, document.text[position:]]), document.encoding)


def _first_new(before: Iterable[Diagnostic], after: Iterable[Diagnostic]) -> Diagnostic | None:
    """Return the first finding that its line did not have before; columns and names in messages may change."""
    counts = Counter((finding.code, finding.place.span.file, finding.place.span.line) for finding in before)
    for finding in after:
        key = finding.code, finding.place.span.file, finding.place.span.line
        counts[key] -= 1
        if counts[key] < 0:
            return finding
    return None
