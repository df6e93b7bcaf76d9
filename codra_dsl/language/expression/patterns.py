"""Patterns of the knowledge graph: text -> syntax tree, with help for common mistakes.

A pattern is a path such as `robot -wants-> detecting`, with an optional `not` before it, or a condition. A condition
reads context-variables, `node.attribute`, `distance(a, b)` and `in_view(node, camera)`; each of these is one name in
the syntax tree.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from codra_dsl.language.expression.poses import parse_with_dotted_names
from codra_dsl.language.expression.tokens import MAX_LENGTH, ExpressionError, SyntaxProblem, is_name, shown
from codra_dsl.language.expression.tree import Name, Node
from codra_dsl.language.frozen import dataclass

MAX_LINKS = 16
"""The maximum number of edges of a path."""

_EXAMPLE = "write a path such as robot -wants-> detecting"
_WORDS = frozenset({"some", "anything", "as", "not"})
_QUANTIFIERS = {"a": "some", "an": "some", "any": "some", "one": "some", "every": "some", "each": "some", "all": "some"}
_TOKEN = re.compile(r"(?P<blank>[ \t\r\n]+)|(?P<name>[^\W\d]\w*)|(?P<sign>->|<-|-)|(?P<other>.)", re.DOTALL)
_TEXT = r""""(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*'"""
_ARROW = re.compile(rf"(?:{_TEXT})|(?P<arrow>->|[-=]>|<-[A-Za-z]\w*-(?!>)|→|←)", re.DOTALL)
_NAME = r"[A-Za-z][A-Za-z0-9_]*"
_THREE_WORDS = re.compile(rf"(?:not\s+)?({_NAME})\s+({_NAME})\s+({_NAME})", re.ASCII)
_OPEN_ARROW = re.compile(rf"(?:not\s+)?({_NAME})\s+-({_NAME})-\s+({_NAME})", re.ASCII)
_OPERATORS = frozenset({"and", "or", "in", "if", "else", "not"})
_SYMBOL_HELP: Mapping[str, str] = {
    "→": "write '->'",
    "←": "write '<-'",
    "[": "write the edge without brackets: -EDGE->",
    "]": "write the edge without brackets: -EDGE->",
    "(": "write the node without parentheses",
    ")": "write the node without parentheses",
    ":": "write some TYPE",
    ",": "write each pattern as an item of its own",
    "=": "write '->'",
    ">": "write '->'",
    ".": "a path has only nodes and edges; write an attribute in a condition of its own",
    "$": "parameters are written $(name), and only inside a template",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeTerm(Node):
    """A node on a path: a named node, some node of a type, or any node.

    Attributes:
        name: the name of a named node; empty for other terms.
        type: the required type; empty for a named node and for any node.
        called: the name after `as`. If two terms of a path have the same name after `as`, they are the same node.
    """

    name: str = ""
    type: str = ""
    called: str = ""

    def __str__(self) -> str:
        """Return the term as written."""
        kind = self.name or (f"some {self.type}" if self.type else "anything")
        return f"{kind} as {self.called}" if self.called else kind


@dataclass(frozen=True, slots=True, kw_only=True)
class EdgeTerm(Node):
    """An edge on a path.

    Attributes:
        edge: the name of the edge's type, or its label.
        is_backward: whether the path follows the edge against its direction.
    """

    edge: str
    is_backward: bool = False

    def __str__(self) -> str:
        """Return the edge as written."""
        return f"<-{self.edge}-" if self.is_backward else f"-{self.edge}->"


@dataclass(frozen=True, slots=True, kw_only=True)
class Path(Node):
    """A sequence of nodes, each connected to the next by an edge.

    Attributes:
        terms: the nodes; there is one node more than there are edges.
        links: the edges.
        negated: whether the pattern states that no such sequence exists.
    """

    terms: tuple[NodeTerm, ...]
    links: tuple[EdgeTerm, ...]
    negated: bool = False

    def steps(self) -> Iterator[tuple[NodeTerm, EdgeTerm, NodeTerm]]:
        """Yield each edge with its origin and its target."""
        for before, link, after in zip(self.terms, self.links, self.terms[1:], strict=False):
            yield (after, link, before) if link.is_backward else (before, link, after)

    def __str__(self) -> str:
        """Return the path as written."""
        words = [str(self.terms[0])]
        for link, term in zip(self.links, self.terms[1:], strict=True):
            words += (str(link), str(term))
        return " ".join([*(["not"] if self.negated else []), *words])


@dataclass(frozen=True, slots=True, kw_only=True)
class Count(Node):
    """`count(PATH)`, the number of matches of a path, or `exists(PATH)`, whether there is a match."""

    function: str
    path: Path


def parse_path(text: str) -> Path:
    """Return the tree of a path, which may be a single node.

    Raises:
        ExpressionError: if the text is not a path.
    """
    return _PathParser(text).parse()


def parse_pattern(text: str) -> Node | SyntaxProblem:
    """Return the tree of a pattern, or the problem of an invalid text. This function never raises."""
    try:
        if len(text) > MAX_LENGTH:
            help_text = f"at most {MAX_LENGTH} are allowed: split it into several patterns"
            raise ExpressionError(f"a pattern of {len(text)} characters is too long", MAX_LENGTH, len(text), help_text)
        is_path = any(match["arrow"] for match in _ARROW.finditer(text))
        return _PathParser(text).parse() if is_path else _condition(text)
    except ExpressionError as error:
        return error.problem


def _condition(text: str) -> Node | SyntaxProblem:
    """Return the tree of a condition in which names may have parts, such as `a.b`. Its offsets refer to `text`."""
    if text in _WORDS:
        raise ExpressionError(f"{shown(text)} is not a pattern by itself", 0, len(text), _EXAMPLE)
    if is_name(text):
        return Name(start=0, end=len(text), name=text)
    words = _THREE_WORDS.fullmatch(text)
    if words is not None and not _OPERATORS & set(words.groups()):
        first, edge, last = words.groups()
        raise ExpressionError(
            f"the arrow of edge {shown(edge)} is missing", *words.span(2), f"write {first} -{edge}-> {last}"
        )
    open_arrow = _OPEN_ARROW.fullmatch(text)
    if open_arrow is not None:
        first, edge, last = open_arrow.groups()
        raise ExpressionError(f"'->' is missing after '{edge}'", *open_arrow.span(2), f"write {first} -{edge}-> {last}")
    return parse_with_dotted_names(text)


@dataclass(frozen=True, slots=True)
class _Token:
    """A token of a path."""

    text: str
    start: int
    end: int

    @property
    def is_name(self) -> bool:
        return self.text[:1].isidentifier()


class _PathParser:
    """Reads one path."""

    def __init__(self, text: str) -> None:
        self._tokens: list[_Token] = []
        self._error: ExpressionError | None = None
        self._position = 0
        try:
            self._tokens.extend(_path_tokens(text))
        except ExpressionError as error:  # raised when the parser reaches this token
            self._error = error
            self._tokens.append(_Token("", error.problem.start, error.problem.end))

    def parse(self) -> Path:
        """Return the path of all tokens."""
        start = self._next_token.start
        negated = self._next_token.text == "not"
        if negated:
            self._take()
        terms, links = [self._term()], list[EdgeTerm]()
        while self._next_token.text:
            links.append(self._link())
            terms.append(self._term())
        if len(links) > MAX_LINKS:
            help_text = f"at most {MAX_LINKS} edges are allowed: split it into several patterns"
            raise ExpressionError("the path is too long", links[MAX_LINKS].start, links[-1].end, help_text)
        return Path(start=start, end=terms[-1].end, terms=tuple(terms), links=tuple(links), negated=negated)

    @property
    def _next_token(self) -> _Token:
        if self._error is not None and self._position == len(self._tokens) - 1:
            raise self._error
        return self._tokens[self._position]

    @property
    def _previous_token(self) -> _Token:
        return self._tokens[self._position - 1]

    def _take(self) -> _Token:
        token = self._tokens[self._position]
        self._position += 1
        return token

    def _term(self) -> NodeTerm:
        """Read a node: NAME, `some TYPE` or `anything`; `as NAME` may follow the latter two."""
        first = self._next_token
        if not first.is_name or first.text in ("as", "not"):
            raise self._missing_node_error()
        self._take()
        if first.text in _QUANTIFIERS and self._next_token.is_name:
            raise ExpressionError(f"{shown(first.text)} is not a node", first.start, first.end, "write 'some'")
        if first.text not in _WORDS:
            return NodeTerm(start=first.start, end=first.end, name=first.text)
        kind = self._name("a type", "after 'some'", "write some TYPE") if first.text == "some" else ""
        called = ""
        if self._next_token.text == "as":
            self._take()
            called = self._name("a name", "after 'as'", "write some TYPE as NAME")
        return NodeTerm(start=first.start, end=self._previous_token.end, type=kind, called=called)

    def _link(self) -> EdgeTerm:
        """Read an edge: `-NAME->`, or `<-NAME-` against its direction."""
        opening = self._next_token
        if opening.text not in ("-", "<-"):
            raise self._missing_edge_error()
        self._take()
        if self._next_token.text == "-":
            raise ExpressionError("one '-' is enough", self._next_token.start, self._next_token.end, "write -EDGE->")
        edge = self._name("an edge", f"after '{opening.text}'", "write -EDGE->")
        is_backward = opening.text == "<-"
        closing = "-" if is_backward else "->"
        if self._next_token.text != closing:
            help_text = f"write <-{edge}-" if is_backward else f"write -{edge}->"
            previous_token = self._previous_token
            raise ExpressionError(
                f"'{closing}' is missing after '{edge}'", previous_token.start, previous_token.end, help_text
            )
        end = self._take().end
        return EdgeTerm(start=opening.start, end=end, edge=edge, is_backward=is_backward)

    def _name(self, noun: str, where: str, help_text: str) -> str:
        token = self._next_token
        if not token.is_name or token.text in _WORDS:
            previous_token = self._previous_token
            raise ExpressionError(f"{noun} is missing {where}", previous_token.start, previous_token.end, help_text)
        return self._take().text

    def _missing_node_error(self) -> ExpressionError:
        previous_token, token = self._previous_token, self._next_token
        if self._position == 0:
            return ExpressionError("a path begins with a node", token.start, max(token.end, 1), _EXAMPLE)
        return ExpressionError(
            f"a node is missing after '{previous_token.text}'", previous_token.start, previous_token.end, _EXAMPLE
        )

    def _missing_edge_error(self) -> ExpressionError:
        previous_token, token = self._previous_token, self._next_token
        if token.text == "->":
            help_text = f"write {previous_token.text} -EDGE->"
            return ExpressionError("'->' without an edge", token.start, token.end, help_text)
        help_text = "write each pattern as an item of its own" if token.text in ("and", "or") else _EXAMPLE
        if token.is_name and token.text not in _OPERATORS and self._tokens[self._position + 1].is_name:
            help_text = f"write -{token.text}->"
        return ExpressionError(f"an edge is missing before {shown(token.text)}", token.start, token.end, help_text)


def _path_tokens(text: str) -> Iterator[_Token]:
    """Yield the tokens of a path, followed by an empty token."""
    for match in _TOKEN.finditer(text):
        start, end = match.span()
        if match["other"]:
            raise ExpressionError(
                f"{shown(match[0])} is not part of a path", start, end, _SYMBOL_HELP.get(match[0], "remove it")
            )
        if match["name"] and not match[0].isascii():
            help_text = "names hold only letters A to Z, digits and '_', and start with a letter"
            raise ExpressionError(f"{shown(match[0])} is not a name", start, end, help_text)
        if not match["blank"]:
            yield _Token(match[0], start, end)
    yield _Token("", len(text), len(text))
