"""Rename a name everywhere, if the specs have the same findings afterwards."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence

from codra_dsl.language.check.conditions.conditions import RESULT_ROLES
from codra_dsl.language.check.index.spec_index import MAIN_EXECUTION, OBSERVER
from codra_dsl.language.check.names.names import OPERATOR
from codra_dsl.language.check.symbols import VALUES, Symbol
from codra_dsl.language.diagnostics import Diagnostic, Edit
from codra_dsl.language.expression import Compare, In, is_identifier, names_in, walk
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.yaml.origin import NOUNS
from codra_dsl.tooling.language_server.documents import Document
from codra_dsl.tooling.language_server.index import Cursor, Index, Range, SpecNames
from codra_dsl.tooling.language_server.other_files import other_file
from codra_dsl.tooling.language_server.projects import Project

_WRITERS = (OBSERVER, MAIN_EXECUTION, OPERATOR)


class RefusedError(Exception):
    """A name cannot be changed. The message states the reason."""


def renameable(cursor: Cursor) -> Range:
    """Return the name at the cursor.

    Raises:
        RefusedError: if there is no name, or if it cannot be changed.
    """
    name_ranges = [name_range for _, name_range in cursor.index.at(cursor)]
    names = sorted({name_range.symbol.name for name_range in name_ranges})
    if not name_ranges:
        raise RefusedError(_reason_without_name(cursor))
    if name_ranges[0].symbol.section == "spec":
        raise RefusedError("the name of a spec is also the name of its generated package, which programs import")
    if not name_ranges[0].is_written:
        written = shown(cursor.document.text[name_ranges[0].start : name_ranges[0].end])
        raise RefusedError(f"a template makes {' and '.join(names)} from {written}")
    return name_ranges[0]


def _reason_without_name(cursor: Cursor) -> str:
    text, specs = cursor.document.text, cursor.index.specs
    around = (re.search(r"\w*$", text[: cursor.offset]), re.match(r"\w*", text[cursor.offset :]))
    word = "".join(match[0] for match in around if match is not None)
    other = other_file(cursor.document, cursor.file)
    if word in _WRITERS:
        return f"{shown(word)} is a word of the language, not a name of the spec"
    if other.kind and other.is_readable and all(names.spec.name != other.spec for names in specs):
        return f"the project has no spec {shown(other.spec)}"
    if not other.kind and all(cursor.file not in names.spec.files for names in specs):
        return f"no spec of the project includes {shown(cursor.file)}, or the spec cannot be read at the moment"
    return "there is no name here, or the text around it cannot be read at the moment"


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
    index, other_files = cursor.index, project.other_files()
    symbols = index.symbols(cursor)
    ranges = index.ranges(symbols, other_files)
    _refuse_unread_names(index, dict.fromkeys(names for names, _ in symbols), other_files)
    _refuse_made_names(cursor, ranges)
    for names, symbol in symbols:
        _refuse_taken_name(names, symbol, new_name)
        if symbol.section == VALUES:
            _refuse_shared_member(names, symbol)
    texts = {
        file: _replaced(index.texts.document(file), file, ranges, new_name) for file in {one.file for one in ranges}
    }
    finding = _first_new(project.checked.diagnostics, project.findings_with(texts))
    if finding is not None:
        span = finding.place.span
        raise RefusedError(f"'{new_name}' would cause {finding.code} at {span.file}:{span.line}: {finding.message}")
    return [Edit(index.texts.document(one.file).span(one.file, one.start, one.end), new_name) for one in ranges]


def _refuse_unread_names(index: Index, specs: Iterable[SpecNames], other_files: Iterable[str]) -> None:
    """Refuse to rename while a text may use the name that cannot be read."""
    spec_names = {"", *(names.spec.name for names in specs)}
    others = ((file, other_file(index.texts.document(file), file)) for file in other_files)
    unread = [file for file, other in others if not other.is_readable and other.spec in spec_names]
    unread += [names.spec.file for names in specs if not index.is_current(names) or not names.is_complete]
    for section, damaged in (item for names in specs for item in names.spec.damaged.items()):
        unread += [f"{NOUNS[section]} '{name}'" for name in sorted(damaged) if section != "spec"]
    if unread:
        raise RefusedError(f"{unread[0]} cannot be read at the moment, so some uses of the name are not known")


def _refuse_made_names(cursor: Cursor, ranges: Sequence[Range]) -> None:
    if not any(name_range.is_declaration for name_range in ranges):
        raise RefusedError("this name is not declared in a spec")
    for symbol, file, start, end, _, is_written in ranges:
        if not is_written:
            document = cursor.index.texts.document(file)
            line = document.position_at(start).line + 1
            raise RefusedError(f"'{symbol.name}' is made from {shown(document.text[start:end])} at {file}:{line}")


def _refuse_taken_name(names: SpecNames, symbol: Symbol, new_name: str) -> None:
    new_symbol = symbol._replace(name=new_name.casefold())
    for other, place in names.declarations.items():
        if other != symbol and other._replace(name=other.name.casefold()) == new_symbol:
            raise RefusedError(f"'{other.name}' is taken: see {place.span.file}:{place.span.line}")


def _refuse_shared_member(names: SpecNames, symbol: Symbol) -> None:
    """Refuse to rename a member of an enum on which something depends that the specs do not show."""
    (algorithm, _, value), member = symbol.owner.rpartition("."), shown(symbol.name)
    if algorithm:
        raise RefusedError(f"the function of algorithm '{algorithm}' returns {member} as '{value}'")
    sources = names.tables.variables[value].sources
    writers = [f"'{source.name}'" for source in sources if source.name != OBSERVER]
    if writers:
        raise RefusedError(f"programs write {member} as {' and '.join(writers)}, and a renaming does not change them")
    for name, element in names.tables.algorithms.items():
        if any(reference.name == value for reference in element.given):
            raise RefusedError(f"the function of algorithm '{name}' gets {member} as '{value}'")
    for site in (site for site in names.tables.sites if site.role not in RESULT_ROLES):
        for part in () if site.condition.tree is None else walk(site.condition.tree):
            compared = {name.name for name in names_in(part)} if isinstance(part, Compare | In) else set()
            if value in compared and len(compared) > 1:
                span = site.condition.place_of(part).span
                raise RefusedError(f"'{value}' is compared with another enum at {span.file}:{span.line}")


def _replaced(document: Document, file: str, ranges: Iterable[Range], new_name: str) -> Document:
    pieces: list[str] = []
    position = 0
    for name_range in ranges:
        if name_range.file == file:
            pieces += [document.text[position : name_range.start], new_name]
            position = name_range.end
    return Document("".join([*pieces, document.text[position:]]))


def _first_new(before: Iterable[Diagnostic], after: Iterable[Diagnostic]) -> Diagnostic | None:
    """Return the first finding that its line did not have before; columns and names in messages may change."""
    counts = Counter((finding.code, finding.place.span.file, finding.place.span.line) for finding in before)
    for finding in after:
        key = finding.code, finding.place.span.file, finding.place.span.line
        counts[key] -= 1
        if counts[key] < 0:
            return finding
    return None
