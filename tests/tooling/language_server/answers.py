"""Complete answers of a server as text: each place has the file, the lines and columns from 1, and the text there."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from lsprotocol import converters, types

from tests.tooling.language_server.buffers import Buffer

_CONVERTER = converters.get_converter()


class Answers:
    """Shows answers about some texts.

    Args:
        texts: the texts of all files, by URI.
        shown_name: returns how a file is shown, from its URI.
        legend: the types and modifiers of semantic tokens.
    """

    def __init__(
        self,
        texts: Mapping[str, Buffer],
        shown_name: Callable[[str], str],
        legend: types.SemanticTokensLegend | None,
    ) -> None:
        self._texts, self._shown_name, self._legend = texts, shown_name, legend

    def findings(self, published: Iterable[types.PublishDiagnosticsParams]) -> str:
        """Show findings, file by file."""
        lines = [
            line
            for params in sorted(published, key=lambda params: self._shown_name(params.uri))
            for diagnostic in params.diagnostics
            for line in self._finding(params.uri, diagnostic)
        ]
        return "\n".join(lines) or "no findings"

    def hover(self, uri: str, hover: types.Hover | None) -> str:
        """Show a hover: its range, and its text."""
        if hover is None:
            return "nothing"
        assert isinstance(hover.contents, types.MarkupContent)
        place = "" if hover.range is None else f"{self._place(uri, hover.range)}\n"
        return f"{place}{hover.contents.value}"

    def locations(self, locations: Any) -> str:
        """Show a place, or places in the order of the answer."""
        listed = [] if locations is None else locations if isinstance(locations, Sequence) else [locations]
        return "\n".join(self._location(location) for location in listed) or "nothing"

    def edits(self, edit: types.WorkspaceEdit | None) -> str:
        """Show the edits of all files."""
        lines = [
            f"{self._place(uri, text_edit.range)} -> {text_edit.new_text!r}"
            for uri, text_edits in sorted(edits_by_uri(edit).items())
            for text_edit in text_edits
        ]
        return "\n".join(lines) or "nothing"

    def completion(self, uri: str, answer: types.CompletionList | Sequence[types.CompletionItem] | None) -> str:
        """Show all items in the order in which an editor sorts them."""
        items = answer.items if isinstance(answer, types.CompletionList) else answer or ()
        ordered = sorted(items, key=lambda item: item.sort_text or item.label)
        return "\n".join(self._item(uri, item) for item in ordered) or "nothing"

    def actions(self, actions: Sequence[types.Command | types.CodeAction] | None) -> str:
        """Show code actions with their edits."""
        lines = []
        for action in actions or ():
            assert isinstance(action, types.CodeAction)
            preferred = ", preferred" if action.is_preferred else ""
            lines.append(f"{action.kind}{preferred}: {action.title}")
            lines += [f"  {line}" for line in self.edits(action.edit).splitlines()]
        return "\n".join(lines) or "nothing"

    def symbols(self, uri: str, symbols: Sequence[Any] | None) -> str:
        """Show document symbols as an outline."""
        return "\n".join(line for symbol in symbols or () for line in self._symbol(uri, symbol, "")) or "nothing"

    def tokens(self, uri: str, tokens: types.SemanticTokens | None) -> str:
        """Show semantic tokens, one per line."""
        assert self._legend is not None
        lines, line, character = [], 0, 0
        data = list(tokens.data) if tokens is not None else []
        for delta_line, delta_character, length, kind, modifiers in zip(*(iter(data),) * 5, strict=True):
            line, character = line + delta_line, delta_character + (0 if delta_line else character)
            place = types.Range(types.Position(line, character), types.Position(line, character + length))
            names = [name for bit, name in enumerate(self._legend.token_modifiers) if modifiers >> bit & 1]
            lines.append(f"{self._place(uri, place)} {' '.join([self._legend.token_types[kind], *names])}")
        return "\n".join(lines) or "nothing"

    def any(self, answer: object) -> str:
        """Show an answer for which there is no other form."""
        return json.dumps(_CONVERTER.unstructure(answer), indent=2, ensure_ascii=False)

    def place(self, uri: str, place: types.Range) -> str:
        """Show a place."""
        return self._place(uri, place)

    def _finding(self, uri: str, diagnostic: types.Diagnostic) -> Iterator[str]:
        assert diagnostic.severity is not None
        code = f"{diagnostic.severity.name.lower()} {diagnostic.code}"
        first, *rest = diagnostic.message.splitlines()
        yield f"{self._place(uri, diagnostic.range)} {code}: {first}"
        yield from (f"  {line}" for line in rest)
        for related in diagnostic.related_information or ():
            yield f"  {self._location(related.location)}: {related.message}"

    def _item(self, uri: str, item: types.CompletionItem) -> str:
        kind = types.CompletionItemKind(item.kind).name if item.kind else "-"
        text = f"{item.label} ({kind})" + (f": {item.detail}" if item.detail else "")
        if isinstance(item.text_edit, types.TextEdit):
            text += f" | {self._place(uri, item.text_edit.range)} -> {item.text_edit.new_text!r}"
        elif item.insert_text not in (None, item.label):
            text += f" | inserts {item.insert_text!r}"
        return text

    def _symbol(self, uri: str, symbol: types.DocumentSymbol, indent: str) -> Iterator[str]:
        detail = f" {symbol.detail}" if symbol.detail else ""
        name_place = self._range(uri, symbol.selection_range)
        whole = f"{_number(symbol.range.start)} to {_number(symbol.range.end)}"
        yield f"{indent}{symbol.kind.name} {symbol.name}{detail} | {name_place} in {whole}"
        for child in symbol.children or ():
            yield from self._symbol(uri, child, f"{indent}  ")

    def _location(self, location: types.Location | types.LocationLink) -> str:
        if isinstance(location, types.LocationLink):
            return self._place(location.target_uri, location.target_selection_range)
        return self._place(location.uri, location.range)

    def _place(self, uri: str, place: types.Range) -> str:
        return f"{self._shown_name(uri)}:{self._range(uri, place)}"

    def _range(self, uri: str, place: types.Range) -> str:
        end = str(place.end.character + 1) if place.end.line == place.start.line else _number(place.end)
        numbers = f"{_number(place.start)}-{end}"
        return f"{numbers} {self._texts[uri].quoted(place)!r}" if uri in self._texts else numbers


def _number(position: types.Position) -> str:
    return f"{position.line + 1}:{position.character + 1}"


def edits_by_uri(edit: types.WorkspaceEdit | None) -> dict[str, list[types.TextEdit]]:
    """Return the edits of each file, in order of their places."""
    by_uri: dict[str, list[types.TextEdit]] = {}
    if edit is not None:
        for uri, text_edits in (edit.changes or {}).items():
            by_uri.setdefault(uri, []).extend(text_edits)
        for change in edit.document_changes or ():
            assert isinstance(change, types.TextDocumentEdit)
            by_uri.setdefault(change.text_document.uri, []).extend(
                text_edit for text_edit in change.edits if isinstance(text_edit, types.TextEdit)
            )
    for text_edits in by_uri.values():
        text_edits.sort(key=lambda text_edit: (text_edit.range.start.line, text_edit.range.start.character))
    return by_uri
