"""Templates as declared: their parameters, and the positions of the parameters in the sections.

The position of a parameter determines the allowed types and the inserted text:

- in a name (a key, a reference, `call`, a unit, ...): only an `identifier`, as the complete name or a part of it;
- as any other complete value: any type; the literal that the use gives is inserted;
- in a condition: any type where a literal is allowed, and an `identifier` as part of a name; between quotes, any
  type; the text of its value is inserted;
- in `label` and `description`, and within the texts under `with`: any type; the text of its value is inserted.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from enum import Enum

from codra_dsl.language.diagnostics import Place
from codra_dsl.language.expression import is_identifier
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.load.schema.document import KEYS, SECTIONS, section_of
from codra_dsl.language.load.schema.keys_and_values import explain, explain_outline
from codra_dsl.language.load.schema.schema import has_shape
from codra_dsl.language.load.templates.parameters import (
    MAX_PARAMETER_REPAIRS,
    PARAMETER,
    ParameterResolver,
    repair_parameter,
)
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.language.load.yaml.names import check_name
from codra_dsl.language.load.yaml.nodes import LetterRuns, MappingNode, ScalarNode, SequenceNode, YamlNode, scalars
from codra_dsl.language.load.yaml.origin import Origin, Subject
from codra_dsl.language.load.yaml.reader import entries, is_unread
from codra_dsl.language.load.yaml.source_offsets import cut, letter_runs
from codra_dsl.language.load.yaml.traps import Openings
from codra_dsl.language.model import Letters, Literal
from codra_dsl.language.units import parse_quantity

DEFINITIONS = {
    "context": "context_variable",
    "perception": "perception_algorithm",
    "skills": "skill",
    "observers": "observer",
    "resources": "resource",
    "agents": "agent",
    "types": "node_type",
    "nodes": "node",
    "edges": "edge",
    "tasks": "task",
    "metrics": "metric",
    "actions": "action",
    "adaptation": "adaptation_rule",
    "trees": "tree",
    "loops": "loop",
}
"""The schema's definition of each section's elements."""

INSTANCE = "instance"
"""The parameter that every template has: the name of the use."""

_KEYS = frozenset({"parameters", *KEYS})
_BARE_WORD = re.compile(r"(?<![$\w(])[A-Za-z]\w*(?![\w)])")
_PARAMETER_MARK = re.compile(r"[$){]")
_WORD_CHARACTER = re.compile(r"[\w$).]")
_TEXT_KEYS = frozenset({"label", "description", "topic", "field"})
_CONDITION_KEYS = frozenset(
    {
        ("context", "derived"),
        *(("perception", key) for key in ("observable_when", "accept_when", "identifies")),
        *(("skills", key) for key in ("preview", "monitor")),
        ("agents", "wakes"),
        ("agents", "rules"),
        ("metrics", "rules"),
        ("actions", "rules"),
        ("adaptation", "value"),
        ("adaptation", "always"),
    }
)


class ParameterKind(Enum):
    """The types of parameters."""

    IDENTIFIER = "identifier"
    BOOL = "bool"
    INT = "int"
    FLOAT = "float"
    STR = "str"
    QUANTITY = "quantity"


class Position(Enum):
    """The kinds of positions at which a parameter can be."""

    NAME = "name"
    VALUE = "value"
    CONDITION = "condition"
    TEXT = "text"
    ARGUMENT = "argument"


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A parameter of a template.

    Attributes:
        default: the value if a use gives none; None if every use must give a value.
        place: the place of the declaration.
    """

    kind: ParameterKind
    key: ScalarNode
    place: Place
    default: ScalarNode | None


@dataclass(frozen=True, slots=True)
class Piece:
    """A piece of a scalar: literal text, or a parameter.

    Attributes:
        parameter: the name of the parameter; empty for literal text.
        text: the piece as written.
        letters: the positions of the letters, counted from the beginning of the piece.
        quote: the quote around the piece in a condition; empty outside quotes.
    """

    parameter: str
    text: str
    letters: LetterRuns
    quote: str = ""


@dataclass(frozen=True, slots=True)
class Pattern:
    """A scalar with parameters."""

    pieces: tuple[Piece, ...]
    position: Position

    @property
    def is_single_parameter(self) -> bool:
        """Whether the scalar has only one piece, the parameter."""
        return len(self.pieces) == 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Template:
    """A template that can be used.

    Attributes:
        patterns: the patterns of the scalars with parameters, by the node's id.
        used_names: the parameters in these scalars.
        parameterized_ids: the ids of these scalars, and of all nodes that contain one.
        unused_names: the parameters that are in no scalar; they have already been reported.
        undeclared_names: names that uses give and patterns contain, but that are not declared; they have already been
            reported.
        damaged: for each element (section, name as written) that is wrong in every use, the keys that cannot be read.
            Nodes with a wrong parameter are marked as reported instead.
        size: the number of keys and values.
        is_lost: whether there may be elements with unknown names.
        is_open: whether there may be parameters with unknown names.
    """

    subject: Subject
    origin: Origin
    sections: Mapping[str, MappingNode]
    parameters: Mapping[str, Parameter]
    patterns: Mapping[int, Pattern]
    used_names: frozenset[str]
    unused_names: frozenset[str]
    undeclared_names: frozenset[str]
    parameterized_ids: frozenset[int]
    damaged: Mapping[tuple[str, str], frozenset[str]]
    size: int
    is_lost: bool
    is_open: bool

    @property
    def name(self) -> str:
        """Return the template's name."""
        return self.subject.name

    def mentions(self) -> Mapping[str, list[Place]]:
        """Return the places of `$(NAME)` for each parameter that is mentioned; a repaired parameter has no place."""
        mentions: dict[str, list[Place]] = {}
        for piece in (piece for pattern in self.patterns.values() for piece in pattern.pieces if piece.parameter):
            place = Letters(self.origin.place, piece.letters).place(0, len(piece.text))
            if place is not None:
                mentions.setdefault(piece.parameter, []).append(place)
        return mentions


def declare(subject: Subject, node: MappingNode, given: Iterable[str], findings: Findings) -> Template:
    """Return a template as declared. Its mistakes are reported here, once for all of its uses.

    `given` has the names of all arguments in all of its uses.
    """
    origin = Origin(subject.origin.source, None, subject.name)
    explain_outline("template", node, subject, findings)
    sections = {key: value for key in SECTIONS if (value := section_of(node, key)) is not None}
    has_bad_key = any(key not in _KEYS and isinstance(value, MappingNode) for key, (_, value) in node.entries.items())
    parameters = _parameters(subject, node, findings)
    has_invalid_name = any(not is_identifier(name) for name in parameters) or is_unread(node.value("parameters"))
    is_open = has_invalid_name or ((has_bad_key or node.unread) and "parameters" not in node.entries)
    resolver = ParameterResolver(subject, origin, sections)
    places = {name: parameter.place for name, parameter in parameters.items()}
    resolver.resolve(places, given, findings, is_open=is_open)
    parameters = {resolver.corrected_declarations.get(name, name): parameter for name, parameter in parameters.items()}
    survey = _Survey(origin, parameters, resolver.corrections, findings)
    for section, elements in sections.items():
        survey.add(section, elements)
    is_lost = has_bad_key or node.unread or any(elements.unread for elements in sections.values())
    unused_names = frozenset(parameters) - survey.used_names - survey.bare_words - resolver.mentioned_names - {INSTANCE}
    if is_lost or survey.is_vague or resolver.unresolved_names:
        unused_names = frozenset()
    _report_unused(subject, [parameters[name] for name in parameters if name in unused_names], findings)
    return Template(
        subject=subject,
        origin=origin,
        sections=sections,
        parameters=parameters,
        patterns=survey.patterns,
        used_names=frozenset(survey.used_names),
        unused_names=unused_names,
        undeclared_names=frozenset(resolver.undeclared_names),
        parameterized_ids=frozenset(survey.parameterized_ids),
        damaged=survey.damaged,
        size=sum(1 for section in sections.values() for _ in scalars(section, lambda _: True)),
        is_lost=is_lost,
        is_open=is_open,
    )


def _report_unused(subject: Subject, parameters: Iterable[Parameter], findings: Findings) -> None:
    for parameter in parameters:
        if not parameter.key.reported:
            name = parameter.key.text
            message = f"the parameter {shown(name)} of {subject} is never used"
            path = subject.part("parameters", name)
            findings.add(
                "unused-parameter", message, parameter.place, help=f"remove it, or use it as $({name})", path=path
            )


def fits(kind: ParameterKind, node: ScalarNode) -> bool:
    """Return whether a literal has a parameter's type."""
    data = node.data
    if kind is ParameterKind.BOOL:
        return isinstance(data, bool)
    if kind is ParameterKind.INT:
        return isinstance(data, int) and not isinstance(data, bool)
    if kind is ParameterKind.FLOAT:
        return isinstance(data, (int, float)) and not isinstance(data, bool)
    if not isinstance(data, str):
        return False
    if kind is ParameterKind.IDENTIFIER:
        return is_identifier(data)
    return kind is ParameterKind.STR or parse_quantity(data) is not None


EXAMPLES: Mapping[ParameterKind, tuple[str, Literal]] = {
    ParameterKind.IDENTIFIER: ("an identifier, for example door", "name"),
    ParameterKind.BOOL: ("true or false", True),
    ParameterKind.INT: ("a whole number, for example 3", 1),
    ParameterKind.FLOAT: ("a number, for example 0.5", 1.0),
    ParameterKind.STR: ("a text; quote a text that looks like a number", "text"),
    ParameterKind.QUANTITY: ("a number with a unit, for example 0.5 m", "1 s"),
}
"""For each type, what to write and an example literal."""


def _parameters(subject: Subject, node: MappingNode, findings: Findings) -> dict[str, Parameter]:
    parameters: dict[str, Parameter] = {}
    for key, value in entries(node.value("parameters")):
        if key.text in (INSTANCE, "template"):
            message = f"the parameter {shown(key.text)} cannot be declared"
            help_text = "$(instance) is the name of the use" if key.text == INSTANCE else "choose another name"
            findings.add(
                "reserved-name", message, subject.origin.of(key), help=help_text, path=subject.part("parameters")
            )
            continue
        if not check_name(key, "a parameter", subject, findings, "parameters", key.text):
            key.reported = True
        parameters[key.text] = _parameter(subject, key, value, findings)
    instance = ScalarNode(INSTANCE, INSTANCE, subject.key.start, subject.key.end, subject.key.style)
    parameters[INSTANCE] = Parameter(
        kind=ParameterKind.IDENTIFIER, key=instance, place=subject.origin.of(subject.key), default=None
    )
    return parameters


def _parameter(subject: Subject, key: ScalarNode, value: YamlNode, findings: Findings) -> Parameter:
    """Return a parameter. If its declaration is wrong, it accepts any literal, so that no further errors follow."""
    declaration = value if isinstance(value, MappingNode) else None
    kind = declaration.value("type") if declaration else value
    default = declaration.value("default") if declaration else None
    default = default if isinstance(default, ScalarNode) and default.data is not None else None
    place = subject.origin.of(key)
    if not has_shape("parameter_declaration", value.data) or not isinstance(kind, ScalarNode) or kind.reported:
        key.reported = True
        return Parameter(kind=ParameterKind.STR, key=key, place=place, default=default)
    parameter = Parameter(kind=ParameterKind(kind.text), key=key, place=place, default=default)
    if default is not None and not default.reported and not fits(parameter.kind, default):
        message = f"the default of {shown(key.text)} must be of type {parameter.kind.value}, not {shown(default.text)}"
        help_text = f"write {EXAMPLES[parameter.kind][0]}"
        path = subject.part("parameters", key.text, "default")
        findings.add("ill-typed-argument", message, subject.origin.of(default), help=help_text, path=path)
        default.reported = True
    return parameter


class _Survey:
    """Walks through a template's sections: checks their shape, and finds every parameter in them.

    Attributes:
        bare_words: the words in conditions that are neither parameters nor keys.
        is_vague: whether there is an unreadable mention, which could mean any parameter.
    """

    def __init__(
        self, origin: Origin, parameters: Mapping[str, Parameter], corrections: Mapping[str, str], findings: Findings
    ) -> None:
        self.patterns: dict[int, Pattern] = {}
        self.parameterized_ids: set[int] = set()
        self.damaged: dict[tuple[str, str], frozenset[str]] = {}
        self.used_names: set[str] = set()
        self.is_vague = False
        self._words: set[str] = set()
        self._keys: set[str] = set()
        self._origin = origin
        self._parameters = parameters
        self._corrections = corrections
        self._findings = findings
        self._path = ""
        self._is_broken = False

    @property
    def bare_words(self) -> frozenset[str]:
        return frozenset(self._words - self._keys)

    def add(self, section: str, elements: MappingNode) -> None:
        """Check the elements of one section."""
        for key, node in elements.entries.values():
            subject = Subject(section, key, self._origin)
            before, self._is_broken = len(self._findings), False
            if not has_shape(DEFINITIONS[section], node.data):
                self.damaged[section, key.text] = explain(DEFINITIONS[section], node, subject, self._findings)
            self._path = subject.path
            if self._scalar(key, Position.NAME) | self._node(node, Position.VALUE, section):
                self.parameterized_ids.add(id(elements))
            if len(self._findings) > before or self._is_broken:
                self.damaged.setdefault((section, key.text), frozenset())

    def _node(self, node: YamlNode, position: Position, section: str) -> bool:
        """Check a node; return whether it contains a parameter."""
        if isinstance(node, ScalarNode):
            return self._scalar(node, position)
        if isinstance(node, SequenceNode):
            holds = [self._node(item, position, section) for item in node.items]
        else:
            holds = [
                self._scalar(key, Position.NAME)
                | self._node(value, _position_of_value(position, section, key.text), section)
                for key, value in node.entries.values()
            ]
        if any(holds):
            self.parameterized_ids.add(id(node))
        return any(holds)

    def _scalar(self, node: ScalarNode, position: Position) -> bool:
        text = node.text
        if position is Position.NAME:
            self._keys.add(text)
        elif position is Position.CONDITION:
            self._words.update(_BARE_WORD.findall(text))
        if node.reported or not (
            "$(" in text or (_PARAMETER_MARK.search(text) and repair_parameter(text, self._parameters))
        ):
            return False
        letters = letter_runs(node, self._origin.source.text)
        for _ in range(MAX_PARAMETER_REPAIRS):
            repair = repair_parameter(text, self._parameters)
            if repair is None or (text.startswith("(") and position in (Position.CONDITION, Position.TEXT)):
                break  # conditions and prose may begin with a parenthesis
            place = Letters(self._origin.place, letters).place(repair.start, repair.end) or self._origin.of(node)
            self._report("ill-formed-parameter", repair.message, place, f"write {repair.parameter}")
            text, letters = repair.text, ()
        pattern = Pattern(_split_text(text, letters, position, self._corrections), position)
        node.reported = True
        are_valid = [self._check_piece(node, pattern, index) for index in range(len(pattern.pieces))]
        if all(are_valid):
            node.reported = False
            self.patterns[id(node)] = pattern
            self.parameterized_ids.add(id(node))
        self._is_broken |= node.reported
        return True

    def _check_piece(self, node: ScalarNode, pattern: Pattern, index: int) -> bool:
        """Report mistakes in one piece of a scalar; return whether it is valid."""
        piece = pattern.pieces[index]
        if not piece.parameter:
            if "$(" in piece.text:
                self.is_vague = True
                message, help_text = "'$(' does not begin a parameter", "write $(name), without blanks"
                self._report("ill-formed-parameter", message, self._place(node, piece), help_text)
            return "$(" not in piece.text
        self.used_names.add(piece.parameter)
        parameter = self._parameters.get(piece.parameter)
        if parameter is None or (parameter.key.reported and pattern.position is Position.CONDITION):
            return False  # this has already been reported, or the value is unknown
        is_literal = parameter.kind is not ParameterKind.IDENTIFIER and not parameter.key.reported
        if is_literal and not _is_literal_allowed(pattern, index):
            message = f"{shown(piece.parameter)} is not an identifier, so it cannot be part of {shown(node.text)}"
            help_text = "declare it as an identifier, or make it the complete value"
            self._report("parameter-in-name", message, self._place(node, piece), help_text)
            return False
        return True

    def _place(self, node: ScalarNode, piece: Piece) -> Place:
        return Letters(self._origin.place, piece.letters).place(0, len(piece.text)) or self._origin.of(node)

    def _report(self, rule: str, message: str, place: Place, help_text: str) -> None:
        self._findings.add(rule, message, place, help=help_text, path=self._path)


def _position_of_value(position: Position, section: str, key: str) -> Position:
    """Return the position of the value of a key, given the position of the mapping around it."""
    if position in (Position.CONDITION, Position.ARGUMENT):
        return position
    if (section, key) in _CONDITION_KEYS:
        return Position.CONDITION
    if (section, key) in (("perception", "with"), ("nodes", "with")):
        return Position.ARGUMENT
    return Position.TEXT if key in _TEXT_KEYS else Position.VALUE


def _split_text(
    text: str, letters: LetterRuns, position: Position, corrections: Mapping[str, str]
) -> tuple[Piece, ...]:
    """Return the pieces of a text, with the names of parameters corrected."""
    pieces: list[Piece] = []
    offset = 0
    for match in PARAMETER.finditer(text):
        start, end = match.span()
        if start > offset:
            pieces.append(Piece("", text[offset:start], cut(letters, offset, start, 0)))
        quote = Openings(text[:start]).quote if position is Position.CONDITION else ""
        first_runs = cut(letters, start, start + 1, 0)
        piece_letters = ((0, first_runs[0][1], end - start),) if first_runs and first_runs[0][2] == 1 else ()
        pieces.append(Piece(corrections.get(match["name"], match["name"]), match[0], piece_letters, quote))
        offset = end
    if offset < len(text):
        pieces.append(Piece("", text[offset:], cut(letters, offset, len(text), 0)))
    return tuple(pieces)


def _is_literal_allowed(pattern: Pattern, index: int) -> bool:
    """Return whether a parameter that is not an identifier is allowed at its position."""
    if pattern.position in (Position.TEXT, Position.ARGUMENT):
        return True
    if pattern.position is not Position.CONDITION:
        return pattern.position is Position.VALUE and pattern.is_single_parameter
    if pattern.pieces[index].quote:
        return True
    before = pattern.pieces[index - 1].text[-1] if index else " "
    after = pattern.pieces[index + 1].text[0] if index + 1 < len(pattern.pieces) else " "
    return not (_WORD_CHARACTER.match(before) or _WORD_CHARACTER.match(after))
