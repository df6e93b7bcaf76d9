"""Select a part of a graph, with selectors as in dbt.

    selector  = part { " " part }                   the union of the parts
    part      = term { "," term }                   the intersection of the terms
    term      = [ "@" | [N] "+" ] names [ "+" [N] ]
    names     = pattern | METHOD ":" pattern

`+x` selects x and everything that x needs, `x+` selects x and everything that needs x, and `2+x` goes back only two
steps. `@x` selects x, everything that needs x, and everything that these nodes need. A pattern is a name, which may
contain `*`, `?` and `[...]`. A pattern with a `/` is matched against complete ids.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fnmatch import fnmatchcase

from codra_dsl.language.diagnostics import suggest
from codra_dsl.language.frozen import dataclass

Edge = tuple[str, str]
"""The ids of a needed node and of a node that needs it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """A node that can be selected.

    Attributes:
        id: the complete name of the node, with `/`.
        label: the name for people.
        file: the file that declares the node.
        use: the use of a template that created the node; empty if no template created it.
    """

    id: str
    name: str
    kind: str
    label: str
    file: str
    use: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Choices:
    """A graph with the nodes that can be selected.

    Attributes:
        kinds: all possible kinds, with or without nodes.
        unneeded_names: declared names that are not nodes.
    """

    nodes: Sequence[Choice]
    edges: Iterable[Edge]
    kinds: Sequence[str]
    unneeded_names: frozenset[str] = frozenset()


class SelectorError(ValueError):
    """Raised for a selector that cannot be parsed, or that has a name, pattern, kind or method that does not exist.

    Attributes:
        column: the position of the error in the selector, from 1.
    """

    def __init__(self, message: str, text: str, start: int, length: int = 1) -> None:
        super().__init__(message)
        self.column = start + 1
        self._text = text
        self._length = max(1, length)

    def __str__(self) -> str:
        """Return the message, the selector below the message, and a mark below the error."""
        shown_text = "".join(letter if letter.isprintable() else " " for letter in self._text)
        marks = " " * (self.column - 1) + "^" * self._length
        return f"{self.args[0]} (column {self.column})\n  {shown_text}\n  {marks}"


def select(choices: Choices, include_selectors: Sequence[str], exclude_selectors: Sequence[str] = ()) -> frozenset[str]:
    """Return the ids of the nodes that match at least one of `include_selectors` and none of `exclude_selectors`.

    Args:
        choices: the graph.
        include_selectors: selectors of nodes to keep; if there are none, all nodes are kept.
        exclude_selectors: selectors of nodes to remove.

    Raises:
        SelectorError: if a selector cannot be parsed, or has a name, pattern, kind or method that does not exist.
    """
    search = _Search(choices)
    all_ids = frozenset(node.id for node in choices.nodes)
    chosen_ids = frozenset().union(*map(search.find_matching_ids, include_selectors)) if include_selectors else all_ids
    return chosen_ids.difference(*map(search.find_matching_ids, exclude_selectors))


_UNLIMITED_STEPS = 10**9
"""More steps than any graph has."""

_TERM = re.compile(
    r"(?P<around>@)?(?:(?P<needs>[0-9]*)\+)?(?:(?P<method>[^:,+@\s]*):)?(?P<pattern>[^:,+@\s]*)(?:(?P<needed>\+)(?P<by>[0-9]*))?"
)
_GLOB = re.compile(r"[*?\[]")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Term:
    """A term of a selector.

    Attributes:
        text: the complete selector.
        start: the position of the term's pattern in the selector.
        need_steps: the number of steps to the nodes that the matched nodes need.
        user_steps: the number of steps to the nodes that need the matched nodes.
        has_at_sign: whether all nodes that need the matched nodes, and everything that these need, are included.
    """

    text: str
    start: int
    method: str | None
    pattern: str
    need_steps: int
    user_steps: int
    has_at_sign: bool

    def error(self, message: str) -> SelectorError:
        """Return an error that marks the pattern."""
        return SelectorError(message, self.text, self.start, len(self.pattern))


def _parse_terms(text: str) -> Iterator[list[_Term]]:
    """Yield the parts of a selector as lists of terms."""
    part_matches = list(re.finditer(r"\S+", text))
    if not part_matches:
        raise SelectorError("the selector is empty", text, 0)
    for part_match in part_matches:
        starts = [part_match.start(), *(part_match.start() + comma.end() for comma in re.finditer(",", part_match[0]))]
        yield [_parse_term(text, start) for start in starts]


def _parse_term(text: str, start: int) -> _Term:
    match = _TERM.match(text, start)
    assert match is not None  # every group of the regular expression may be empty
    pattern_start, end = match.start("pattern"), match.end()
    if not match["pattern"]:
        raise SelectorError(
            "a name is missing; a selector has no blanks around '+' and ','", text, min(pattern_start, len(text))
        )
    if end < len(text) and text[end] != "," and not text[end].isspace():
        raise SelectorError(f"{text[end]!r} is not allowed here", text, end)
    if match["around"] and (match["needs"] is not None or match["needed"]):
        error_start = match.start("needed") if match["needed"] else match.end("around")
        raise SelectorError("'@' already goes both ways: leave out the '+'", text, error_start)
    return _Term(
        text=text,
        start=pattern_start,
        method=match["method"],
        pattern=match["pattern"],
        need_steps=_step_count(match["needs"]),
        user_steps=_step_count(match["by"]),
        has_at_sign=match["around"] is not None,
    )


def _step_count(digits: str | None) -> int:
    """Return the number of steps: 0 without a `+`, and all steps for a `+` without a number."""
    if digits is None:
        return 0
    return int(digits) if digits and len(digits) < len(str(_UNLIMITED_STEPS)) else _UNLIMITED_STEPS


class _Search:
    """Finds the nodes in one graph that match selectors."""

    def __init__(self, choices: Choices) -> None:
        self._choices = choices
        self._needs_by_node: dict[str, list[str]] = {}
        self._users_by_node: dict[str, list[str]] = {}
        for need, user in choices.edges:
            self._needs_by_node.setdefault(user, []).append(need)
            self._users_by_node.setdefault(need, []).append(user)
        self._methods: Mapping[str, Callable[[_Term], frozenset[str]]] = {
            "kind": self._match_kind,
            "file": self._match_file,
            "use": self._match_use,
        }

    def find_matching_ids(self, text: str) -> frozenset[str]:
        """Return the ids of the nodes that a selector matches."""
        id_sets_by_part = [[self._ids_of_term(term) for term in terms] for terms in _parse_terms(text)]
        return frozenset().union(*(frozenset.intersection(*id_sets) for id_sets in id_sets_by_part))

    def _ids_of_term(self, term: _Term) -> frozenset[str]:
        matched_ids = self._match_name(term) if term.method is None else self._find_method(term, term.method)(term)
        if term.has_at_sign:
            return _reachable_ids(
                self._needs_by_node,
                _reachable_ids(self._users_by_node, matched_ids, _UNLIMITED_STEPS),
                _UNLIMITED_STEPS,
            )
        return _reachable_ids(self._needs_by_node, matched_ids, term.need_steps) | _reachable_ids(
            self._users_by_node, matched_ids, term.user_steps
        )

    def _match_name(self, term: _Term) -> frozenset[str]:
        is_id = "/" in term.pattern
        keys_and_ids = ((node.id if is_id else node.name, node.id) for node in self._choices.nodes)
        return self._find_matching_ids(term, keys_and_ids, self._help_for_name)

    def _match_kind(self, term: _Term) -> frozenset[str]:
        kinds = self._choices.kinds
        if not any(fnmatchcase(kind, term.pattern) for kind in kinds):
            raise term.error(f"there is no kind {term.pattern!r}: {_choice_hint(term.pattern, kinds)}")
        return frozenset(node.id for node in self._choices.nodes if fnmatchcase(node.kind, term.pattern))

    def _match_file(self, term: _Term) -> frozenset[str]:
        return self._find_matching_ids(
            term, ((node.file, node.id) for node in self._choices.nodes), self._help_for_value
        )

    def _match_use(self, term: _Term) -> frozenset[str]:
        keys_and_ids = ((node.use, node.id) for node in self._choices.nodes if node.use)
        return self._find_matching_ids(term, keys_and_ids, self._help_for_value)

    def _find_matching_ids(
        self, term: _Term, keys_and_ids: Iterable[tuple[str, str]], make_help: Callable[[_Term, Sequence[str]], str]
    ) -> frozenset[str]:
        """Return the ids of the nodes with a key that matches the pattern of a term. No match is an error."""
        key_id_pairs = list(keys_and_ids)
        is_glob = _GLOB.search(term.pattern) is not None
        matching_ids = frozenset(
            node_id
            for key, node_id in key_id_pairs
            if (fnmatchcase(key, term.pattern) if is_glob else key == term.pattern)
        )
        if not matching_ids and is_glob:
            raise term.error(f"no node matches {term.pattern!r}")
        if not matching_ids:
            known_keys = list(dict.fromkeys(key for key, _ in key_id_pairs))
            raise term.error(f"no node matches {term.pattern!r}{make_help(term, known_keys)}")
        return matching_ids

    def _help_for_name(self, term: _Term, known_keys: Sequence[str]) -> str:
        names_with_label = [
            node.name for node in self._choices.nodes if node.label.casefold() == term.pattern.casefold()
        ]
        if names_with_label:
            return f": that is the label of '{names_with_label[0]}'"
        if term.pattern in self._choices.unneeded_names:
            return " in the graph: it is declared, but no decision needs it"
        return self._help_for_value(term, known_keys)

    def _help_for_value(self, term: _Term, known_keys: Sequence[str]) -> str:
        similar_name = suggest(term.pattern, known_keys)
        return f" (did you mean '{similar_name}'?)" if similar_name else ""

    def _find_method(self, term: _Term, name: str) -> Callable[[_Term], frozenset[str]]:
        if name not in self._methods:
            message = f"there is no method {name!r}: {_choice_hint(name, tuple(self._methods))}"
            raise SelectorError(message, term.text, term.start - len(name) - 1, len(name))
        return self._methods[name]


def _choice_hint(name: str, allowed_names: Sequence[str]) -> str:
    similar_name = suggest(name, allowed_names)
    return f"did you mean '{similar_name}'?" if similar_name else f"choose from {', '.join(allowed_names)}"


def _reachable_ids(neighbours: Mapping[str, Sequence[str]], start_ids: frozenset[str], steps: int) -> frozenset[str]:
    """Return the start nodes, and the nodes that can be reached from them in at most `steps` steps."""
    reached_ids, frontier = set(start_ids), start_ids
    while frontier and steps:
        frontier = (
            frozenset(neighbour for node_id in frontier for neighbour in neighbours.get(node_id, ())) - reached_ids
        )
        reached_ids |= frontier
        steps -= 1
    return frozenset(reached_ids)
