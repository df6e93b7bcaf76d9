"""Substitute a use's literals into a template's sections: nodes -> nodes. Uses share the nodes without parameters."""

from __future__ import annotations

from collections.abc import Mapping

from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.load.templates.templates import EXAMPLES, Parameter, ParameterKind, Piece, Position, Template
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.language.load.yaml.nodes import FilledText, MappingNode, ScalarNode, SequenceNode, Style, YamlNode
from codra_dsl.language.load.yaml.origin import Origin
from codra_dsl.language.model import Literal

MAX_FILLED_TEXT = 64 * 1024
"""The maximum length of a text after substitution, in code points."""


@dataclass(frozen=True, slots=True)
class BoundValue:
    """The value of a parameter in one use.

    Attributes:
        text: the value as written, without quotes.
        is_known: whether the value comes from the use or a default; otherwise it is only an example of the type.
    """

    kind: ParameterKind
    text: str
    data: Literal
    is_known: bool = True


def bind(parameter: Parameter, node: ScalarNode) -> BoundValue:
    """Return the value of a parameter from a literal of its type."""
    data = node.data if node.data is not None else ""
    if parameter.kind is ParameterKind.FLOAT:
        return BoundValue(parameter.kind, repr(data), data)
    text = str(data).lower() if isinstance(data, bool) else str(data)
    return BoundValue(parameter.kind, text, data)


def example_value(parameter: Parameter) -> BoundValue:
    """Return an example value of a parameter: its default, or some literal of its type."""
    if parameter.default is not None and not parameter.default.reported:
        return bind(parameter, parameter.default)
    if parameter.kind is ParameterKind.IDENTIFIER:
        return BoundValue(parameter.kind, parameter.key.text, parameter.key.text, is_known=False)
    data = EXAMPLES[parameter.kind][1]
    return BoundValue(parameter.kind, str(data).lower() if isinstance(data, bool) else str(data), data, is_known=False)


class Filler:
    """Substitutes the parameters of a template for one use."""

    def __init__(self, template: Template, bindings: Mapping[str, BoundValue]) -> None:
        self._clashes: list[ScalarNode] = []
        self._overlong_nodes: list[ScalarNode] = []
        self._template = template
        self._bindings = bindings

    def sections(self) -> dict[str, MappingNode]:
        """Return the template's sections with parameters substituted."""
        return {key: self._mapping(node) for key, node in self._template.sections.items()}

    def report(self, origin: Origin, findings: Findings) -> None:
        """Report keys that became equal by the substitution, and texts that became too long."""
        path = f"templates.{origin.template}"
        for key in self._clashes:
            message = f"the key {shown(key.text)} occurs twice after substitution of parameters"
            help_text = "give the parameters different values"
            findings.add("duplicate-key", message, origin.of(key), help=help_text, path=path)
        for node in self._overlong_nodes:
            message, help_text = "parameters make this text too long", f"at most {MAX_FILLED_TEXT} letters are allowed"
            findings.add("text-too-long", message, origin.of(node), help=help_text, path=path)

    def _fill(self, node: YamlNode) -> YamlNode:
        if id(node) not in self._template.parameterized_ids:
            return node
        if isinstance(node, ScalarNode):
            return self._scalar(node)
        return self._sequence(node) if isinstance(node, SequenceNode) else self._mapping(node)

    def _sequence(self, node: SequenceNode) -> SequenceNode:
        filled_node = SequenceNode(node.start, node.end, flow=node.flow)
        filled_node.reported = node.reported
        filled_node.items = [self._fill(item) for item in node.items]
        filled_node.data = [item.data for item in filled_node.items]
        return filled_node

    def _mapping(self, node: MappingNode) -> MappingNode:
        if id(node) not in self._template.parameterized_ids:
            return node
        filled_node = MappingNode(node.start, node.end, flow=node.flow)
        filled_node.reported, filled_node.unread = node.reported, node.unread
        for key, value in node.entries.values():
            new_key = self._scalar(key) if id(key) in self._template.parameterized_ids else key
            if new_key.text in filled_node.entries:
                self._clashes.append(new_key)
            else:
                filled_node.put(new_key, self._fill(value))
        return filled_node

    def _scalar(self, node: ScalarNode) -> ScalarNode:
        pattern = self._template.patterns[id(node)]
        if pattern.is_single_parameter and pattern.position in (Position.VALUE, Position.ARGUMENT):
            return self._literal(node, pattern.pieces[0])
        pieces = tuple((self._text(piece, pattern.position), piece.letters) for piece in pattern.pieces)
        text = "".join([text for text, _ in pieces])
        if len(text) > MAX_FILLED_TEXT:
            self._overlong_nodes.append(node)
            return node
        filled_node = ScalarNode(text, text, node.start, node.end, node.style)
        filled_node.reported = node.reported
        filled_node.filled_text = FilledText(node.text, pieces)
        return filled_node

    def _literal(self, node: ScalarNode, piece: Piece) -> ScalarNode:
        bound = self._bindings[piece.parameter]
        is_quoted = bound.kind in (ParameterKind.STR, ParameterKind.IDENTIFIER)
        filled_node = ScalarNode(
            bound.text, bound.data, node.start, node.end, Style.DOUBLE_QUOTED if is_quoted else Style.PLAIN
        )
        filled_node.reported = node.reported or (not bound.is_known and bound.kind is not ParameterKind.IDENTIFIER)
        filled_node.filled_text = FilledText(node.text, ((bound.text, ((0, node.start, node.end - node.start),)),))
        return filled_node

    def _text(self, piece: Piece, position: Position) -> str:
        if not piece.parameter:
            return piece.text
        bound = self._bindings[piece.parameter]
        if position is not Position.CONDITION:
            return bound.text
        quote = piece.quote
        if quote:
            return _escape(bound.text, quote)
        return f'"{_escape(bound.text, chr(34))}"' if bound.kind is ParameterKind.STR else bound.text


def _escape(text: str, quote: str) -> str:
    """Return a text escaped for a place between quotes in a condition."""
    return text.replace("\\", "\\\\").replace(quote, f"\\{quote}").replace("\n", "\\n").replace("\t", "\\t")
