"""The text that an editor shows about a name, the symbols of a file, and the colours of conditions."""

from __future__ import annotations

from collections.abc import Iterator

from lsprotocol import types

from codra_dsl.language.check.conditions.conditions import RESULT_ROLES
from codra_dsl.language.check.index.spec_index import OBSERVER
from codra_dsl.language.check.index.words import USERS
from codra_dsl.language.check.symbols import PARAMETERS, RETURNS, VALUES, Symbol
from codra_dsl.language.expression import FUNCTIONS
from codra_dsl.language.expression.tokens import ExpressionError, TokenKind, tokens
from codra_dsl.language.load.site.site_file import SITE_KEY
from codra_dsl.language.model import FOREVER_S, Condition, ValueType, Variable, WhenUnobservable
from codra_dsl.tooling.language_server.index import Cursor, Index, SpecNames
from codra_dsl.tooling.language_server.other_files import other_file

_MAX_SHOWN_NAMES = 3


def hover(cursor: Cursor) -> types.Hover | None:
    """Return the description of the name at a cursor."""
    matches = cursor.index.at(cursor)
    site = cursor.file if any(_site(names) == cursor.file for names, _ in matches) else ""
    texts = dict.fromkeys(
        _description(names, name_range.symbol) for names, name_range in matches if _site(names) == site
    )
    if not texts:
        return None
    document = cursor.document
    text = "\n\n---\n\n".join(list(texts)[:_MAX_SHOWN_NAMES])
    return types.Hover(
        types.MarkupContent(types.MarkupKind.Markdown, text),
        document.range_between(matches[0][1].start, matches[0][1].end),
    )


def _site(names: SpecNames) -> str:
    """Return the file of the site whose values a spec has; empty without a site."""
    return "" if names.spec.site is None else names.spec.site.file


def _description(names: SpecNames, symbol: Symbol) -> str:
    tables = names.tables
    if symbol.section == "context" and symbol.name in tables.variables:
        return "\n".join(_variable_lines(names, tables.variables[symbol.name]))
    if symbol.section == RETURNS:
        algorithm = tables.algorithms.get(symbol.owner)
        value = next((value for value in algorithm.returns if value.name == symbol.name), None) if algorithm else None
        type_text = "" if value is None else f": {_type_text(value.type)}{', optional' if value.optional else ''}"
        return f"`{symbol.name}`{type_text}\n\nreturned by algorithm `{symbol.owner}`"
    if symbol.section == VALUES:
        return f"member `{symbol.name}` of `{symbol.owner}`"
    if symbol.section == PARAMETERS:
        templates = (template for template in names.spec.templates if template.name == symbol.owner)
        parameters = (parameter for template in templates for parameter in template.parameters)
        summary = next((parameter.summary for parameter in parameters if parameter.name == symbol.name), "")
        return f"parameter `{symbol.name}` of template `{symbol.owner}`: {summary}"
    noun = USERS.get(symbol.section, symbol.section.removesuffix("s"))
    elements = getattr(names.spec, symbol.section, ())
    labels = (getattr(element, "label", "") for element in elements if getattr(element, "name", "") == symbol.name)
    label = next(labels, "")
    return f"{noun} `{symbol.name}`{f': {label}' if label else ''}"


def _variable_lines(names: SpecNames, variable: Variable) -> Iterator[str]:
    yield f"context-variable `{variable.name}`: {_type_text(variable.type)}"
    label = "" if variable.label == variable.name else variable.label
    if label or variable.description:
        yield f"\n{' - '.join(filter(None, (label, variable.description)))}"
    yield ""
    tables = names.tables
    producers = tables.producers.get(variable.name, ())
    for name in producers:
        conditions = tables.algorithms[name].observable_when
        texts = " and ".join(f"`{condition.text}`" for condition in conditions)
        yield f"- identified by algorithm `{name}`{f', when {texts}' if texts else ''}"
    if variable.name in tables.claims:
        yield f"- in observer `{tables.claims[variable.name][0].name}`"
    if variable.derived is not None:
        yield f"- derived: `{variable.derived.text}`"
    if variable.rate is not None:
        rate = variable.rate
        yield f"- computed by loops: `{rate.kind}: {rate.of.name}, {rate.duration_key}: {rate.over_s:g} s`"
    sources = () if variable.is_computed or variable.rate is not None else variable.sources
    writers = [source.name for source in sources if source.name != OBSERVER]
    if writers:
        yield f"- written by {', '.join(f'`{writer}`' for writer in writers)}"
    yield f"- unknown {'; '.join(_reasons(names, variable))}"
    bound_s = names.worst_cases.get(variable.name)
    if bound_s is not None:
        yield f"- known at most {bound_s:g} s after its declaration"


def _reasons(names: SpecNames, variable: Variable) -> Iterator[str]:
    """Yield the reasons why a variable can be unknown."""
    tables = names.tables
    producers = [tables.algorithms[name] for name in tables.producers.get(variable.name, ())]
    if variable.is_computed:
        inputs = ", ".join(f"`{name}`" for name in tables.derived_inputs.get(variable.name, ()))
        yield f"while {inputs or 'what it is computed from'} is unknown and decides the value"
        return
    done = "identified" if producers else "written" if variable.rate is None else "computed"
    yield f"until it is {done} for the first time"
    if variable.valid_for_s < FOREVER_S:
        yield f"when its evidence is older than {variable.valid_for_s:g} s"
    if producers and variable.when_unobservable is WhenUnobservable.FORGET:
        yield "as soon as a precondition fails or a result is rejected"
    changes = ((skill.name, change.name) for skill in names.spec.skills for change in skill.changes)
    skills = [f"`{skill}`" for skill, name in changes if name == variable.name]
    if skills:
        yield f"after {', '.join(skills)} has changed it"


def _type_text(value_type: ValueType) -> str:
    """Return a type with its unit, range and members."""
    members = f" of {', '.join(value_type.values)}" if value_type.values else ""
    unit = f" in {value_type.unit}" if value_type.unit else ""
    limits = value_type.range
    return f"{value_type.kind}{members}{unit}{f' from {limits[0]:g} to {limits[1]:g}' if limits else ''}"


_SYMBOL_KINDS = {
    "context": types.SymbolKind.Variable,
    "perception": types.SymbolKind.Function,
    "skills": types.SymbolKind.Event,
    "agents": types.SymbolKind.Interface,
    "types": types.SymbolKind.Class,
    "nodes": types.SymbolKind.Object,
    "templates": types.SymbolKind.Module,
}
_NOT_IN_OUTLINES = (RETURNS, VALUES, PARAMETERS, "spec")


def symbols(cursor: Cursor) -> list[types.DocumentSymbol]:
    """Return the declarations in a file, as a template writes them, or the names in a site."""
    document, other = cursor.document, other_file(cursor.document, cursor.file)
    declared = (name_range for name_range in cursor.index.in_file(cursor.file) if name_range.is_declaration)
    entries = {(name_range.start, name_range.end): name_range.symbol.section for name_range in declared}
    if other.kind == SITE_KEY:
        entries = {(name_range.start, name_range.end): name_range.section for name_range in other.names}
    shown: list[types.DocumentSymbol] = []
    for (start, end), section in sorted(entries.items()):
        if section not in _NOT_IN_OUTLINES:
            selection = document.range_between(start, end)
            extent = types.Range(selection.start, document.position_at(document.end_of_entry(start)))
            kind = _SYMBOL_KINDS.get(section, types.SymbolKind.Object)
            shown.append(types.DocumentSymbol(document.text[start:end], kind, extent, selection, section))
    return shown


TOKEN_TYPES = ("variable", "parameter", "number", "string", "keyword", "operator", "function")
"""The types of semantic tokens: names of context, returned values, numbers, texts, words, symbols and functions."""

_TOKEN_TYPES = {TokenKind.NUMBER: 2, TokenKind.TEXT: 3, TokenKind.WORD: 4, TokenKind.SYMBOL: 5}


def semantic_tokens(cursor: Cursor) -> types.SemanticTokens:
    """Return the types of the words in the conditions of a file."""
    index, file = cursor.index, cursor.file
    document = cursor.document
    types_by_range: dict[tuple[int, int], int] = {}
    for names in index.specs:
        for site in names.tables.sites:
            if site.condition.place.span.file == file:
                is_result = site.role in RESULT_ROLES
                for start, end, token_type in _tokens(site.condition, index, names, file, is_result=is_result):
                    types_by_range.setdefault((start, end), token_type)
    data: list[int] = []
    last, last_end = types.Position(0, 0), 0
    for (start, end), token_type in sorted(types_by_range.items()):
        position, after = document.position_at(start), document.position_at(end)
        if position.line == after.line and start >= last_end:
            is_same_line = position.line == last.line
            column = position.character - (last.character if is_same_line else 0)
            data += [position.line - last.line, column, after.character - position.character, token_type, 0]
            last, last_end = position, end
    return types.SemanticTokens(data)


def _tokens(
    condition: Condition, index: Index, names: SpecNames, file: str, *, is_result: bool
) -> Iterator[tuple[int, int, int]]:
    """Yield the ranges of the words of a condition in the newest text, with their types."""
    try:
        condition_tokens = tokens(condition.text)
    except ExpressionError:  # patterns and poses have another grammar
        return
    document, move = names.texts.document(file), index.move(names, file)
    for token in condition_tokens[:-1]:
        span = condition.place_between(token.start, token.end).span
        start, end = document.offsets_of(span)
        written = document.text[start:end] if span.file == file else ""
        token_range = move.range(start, end) if written == token.text or "$(" in written else None
        if token_range is not None:  # `x stays 1` is the condition `x == 1`, of which `==` is not written
            name_type = 6 if token.text in FUNCTIONS else int(is_result)
            yield *token_range, _TOKEN_TYPES.get(token.kind, name_type)
