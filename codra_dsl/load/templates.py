"""Templates as declared: parameters, and where in the sections they stand.

How a parameter may be used depends on where it stands:

- in a name (a key, a reference, `call`, a unit, ...): an `identifier`, as part of it or as the whole;
- as the whole of any other value: the literal that a use gives;
- in a condition: a literal where a literal may stand, an `identifier` as part of a name; between quotes, its text;
- in `label` and `description`, and within the texts under `with`: anything, as its text.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum

from codra_dsl.diagnostics import Place
from codra_dsl.expression.tokens import shown
from codra_dsl.load.document import KEYS, SECTIONS, section_of
from codra_dsl.load.findings import Findings
from codra_dsl.load.letters import cut, letters_of
from codra_dsl.load.names import check_name, is_identifier
from codra_dsl.load.nodes import Letters, MappingNode, ScalarNode, SequenceNode, YamlNode, scalars
from codra_dsl.load.origin import Origin, Subject
from codra_dsl.load.parameters import MAX_PUT_RIGHT, PARAMETER, Meanings, put_right
from codra_dsl.load.reader import entries, is_unread
from codra_dsl.load.schema import sound
from codra_dsl.load.shape import explain, explain_outline
from codra_dsl.load.traps import Openings
from codra_dsl.model import DeclaredTemplate, Literal, Reference
from codra_dsl.model import Letters as PlacedLetters
from codra_dsl.units import parse_quantity

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

_KNOWN = frozenset({"parameters", *KEYS})
_BARE_WORD = re.compile(r"(?<![$\w(])[A-Za-z]\w*(?![\w)])")
_MAY_SLIP = re.compile(r"[$){]")
_SOLID = re.compile(r"[\w$).]")
_TEXT_KEYS = frozenset({"label", "description"})
_CONDITION_KEYS = frozenset(
    {
        ("perception", "observable_when"),
        ("perception", "accept_when"),
        ("perception", "identifies"),
        ("skills", "monitor"),
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
    """Where a parameter stands."""

    NAME = "name"
    VALUE = "value"
    CONDITION = "condition"
    TEXT = "text"
    ARGUMENT = "argument"


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A parameter of a template.

    Attributes:
        default: the literal that stands for it where a use does not say; None where each use must.
        place: of its declaration.
    """

    kind: ParameterKind
    key: ScalarNode
    place: Place
    default: ScalarNode | None


@dataclass(frozen=True, slots=True)
class Piece:
    """A piece of a scalar: literal text, or a parameter.

    Attributes:
        parameter: its name; empty for literal text.
        text: as written.
        letters: where its letters stand, counted from its beginning.
        between: the quote that it stands between in a condition; empty outside quotes.
    """

    parameter: str
    text: str
    letters: Letters
    between: str = ""


@dataclass(frozen=True, slots=True)
class Pattern:
    """A scalar with parameters."""

    pieces: tuple[Piece, ...]
    position: Position

    @property
    def is_whole(self) -> bool:
        """Whether it is one parameter and nothing else."""
        return len(self.pieces) == 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Template:
    """A template that can be used.

    Attributes:
        patterns: of the scalars with parameters, by the node's id.
        used: the parameters that stand in them.
        touched: ids of all nodes that hold such a scalar.
        unused: the parameters that stand in none, which has been reported.
        undeclared: names that uses give and patterns have, but which are no parameters, which has been reported.
        damaged: by (section, name as written) of elements that are wrong whatever a use says, the keys that cannot be
            read; those with a wrong parameter are marked as reported instead.
        size: how many keys and values it has.
        is_lost: whether there may be elements of which nobody knows the names.
        is_open: whether there may be parameters of which nobody knows the names.
    """

    subject: Subject
    origin: Origin
    sections: Mapping[str, MappingNode]
    parameters: Mapping[str, Parameter]
    patterns: Mapping[int, Pattern]
    used: frozenset[str]
    unused: frozenset[str]
    undeclared: frozenset[str]
    touched: frozenset[int]
    damaged: Mapping[tuple[str, str], frozenset[str]]
    size: int
    is_lost: bool
    is_open: bool

    @property
    def name(self) -> str:
        """Return the template's name."""
        return self.subject.name


def declare(subject: Subject, node: MappingNode, given: Iterable[str], findings: Findings) -> Template:
    """Return a template as declared; what is wrong with it is reported here, once, however often it is used.

    `given` has the names of all arguments in all of its uses.
    """
    origin = Origin(subject.origin.source, None, subject.name)
    explain_outline("template", node, subject, findings)
    sections = {key: value for key in SECTIONS if (value := section_of(node, key)) is not None}
    strange = any(key not in _KNOWN and isinstance(value, MappingNode) for key, (_, value) in node.entries.items())
    parameters = _parameters(subject, node, findings)
    unnamed = any(not is_identifier(name) for name in parameters) or is_unread(node.value("parameters"))
    is_open = unnamed or ((strange or node.unread) and "parameters" not in node.entries)
    meanings = Meanings(subject, origin, sections)
    places = {name: parameter.place for name, parameter in parameters.items()}
    meanings.settle(places, given, findings, is_open=is_open)
    parameters = {meanings.renamed.get(name, name): parameter for name, parameter in parameters.items()}
    survey = _Survey(origin, parameters, meanings.meant, findings)
    for section, elements in sections.items():
        survey.add(section, elements)
    lost = strange or node.unread or any(elements.unread for elements in sections.values())
    unused = frozenset(parameters) - survey.used - survey.bare_words - meanings.named - {INSTANCE}
    if lost or survey.is_vague or meanings.strange:
        unused = frozenset()
    _report_unused(subject, [parameters[name] for name in parameters if name in unused], findings)
    return Template(
        subject=subject,
        origin=origin,
        sections=sections,
        parameters=parameters,
        patterns=survey.patterns,
        used=frozenset(survey.used),
        unused=unused,
        undeclared=frozenset(meanings.undeclared),
        touched=frozenset(survey.touched),
        damaged=survey.damaged,
        size=sum(1 for section in sections.values() for _ in scalars(section, lambda _: True)),
        is_lost=lost,
        is_open=is_open,
    )


def _report_unused(subject: Subject, parameters: Iterable[Parameter], findings: Findings) -> None:
    for parameter in parameters:
        if not parameter.key.reported:
            name = parameter.key.text
            message = f"the parameter {shown(name)} of {subject} is never used"
            path = subject.part("parameters", name)
            findings.add("unused-parameter", message, parameter.place, help=f"remove it, or write $({name})", path=path)


def declared(template: Template, *, is_used: bool) -> DeclaredTemplate:
    """Return what a spec keeps of a template: what it declares and what it names outside of itself."""
    return DeclaredTemplate(
        name=template.name,
        place=template.subject.origin.of(template.subject.key),
        is_used=is_used,
        parameters=tuple(
            Reference(name=name, place=parameter.place)
            for name, parameter in template.parameters.items()
            if name != INSTANCE
        ),
        resources=tuple(_named(template.sections.get("perception"), "uses")),
        sources=tuple(_writers(template.sections)),
    )


def _writers(sections: Mapping[str, MappingNode]) -> Iterator[str]:
    """Yield the names of those who may write what a template makes, or who take part in its tasks."""
    for section in ("context", "types", "edges"):
        yield from _named(sections.get(section), "source")
    for section in ("types", "edges"):
        for _, element in entries(sections.get(section)):
            yield from _named(element.value("attributes") if isinstance(element, MappingNode) else None, "source")
    for key in ("by", "requesters"):
        yield from _named(sections.get("tasks"), key)


def _named(elements: YamlNode | None, key: str) -> Iterator[str]:
    """Yield the names that the elements of a section state under a key: one, a list of them, or keys of a mapping."""
    for _, element in entries(elements):
        stated = element.value(key) if isinstance(element, MappingNode) else None
        if isinstance(stated, ScalarNode):
            yield stated.text
        elif isinstance(stated, SequenceNode):
            yield from (item.text for item in stated.items if isinstance(item, ScalarNode))
        elif isinstance(stated, MappingNode):
            yield from stated.entries


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
    ParameterKind.STR: ("a text; quote what looks like a number", "text"),
    ParameterKind.QUANTITY: ("a number with a unit, for example 0.5 m", "1 s"),
}
"""What to write for each type, and a literal of it."""


def _parameters(subject: Subject, node: MappingNode, findings: Findings) -> dict[str, Parameter]:
    found: dict[str, Parameter] = {}
    for key, value in entries(node.value("parameters")):
        if key.text in (INSTANCE, "template"):
            message = f"the parameter {shown(key.text)} cannot be declared"
            way_out = "$(instance) is the name of the use" if key.text == INSTANCE else "choose another name"
            findings.add(
                "reserved-name", message, subject.origin.of(key), help=way_out, path=subject.part("parameters")
            )
            continue
        if not check_name(key, "a parameter", subject, findings, "parameters", key.text):
            key.reported = True
        found[key.text] = _parameter(subject, key, value, findings)
    instance = ScalarNode(INSTANCE, INSTANCE, subject.key.start, subject.key.end, subject.key.style)
    found[INSTANCE] = Parameter(
        kind=ParameterKind.IDENTIFIER, key=instance, place=subject.origin.of(subject.key), default=None
    )
    return found


def _parameter(subject: Subject, key: ScalarNode, value: YamlNode, findings: Findings) -> Parameter:
    """Return a parameter; one whose declaration is wrong takes any literal, so that nothing follows from that."""
    declaration = value if isinstance(value, MappingNode) else None
    kind = declaration.value("type") if declaration else value
    default = declaration.value("default") if declaration else None
    default = default if isinstance(default, ScalarNode) and default.data is not None else None
    place = subject.origin.of(key)
    if not sound("parameter_declaration", value.data) or not isinstance(kind, ScalarNode) or kind.reported:
        key.reported = True
        return Parameter(kind=ParameterKind.STR, key=key, place=place, default=default)
    parameter = Parameter(kind=ParameterKind(kind.text), key=key, place=place, default=default)
    if default is not None and not default.reported and not fits(parameter.kind, default):
        message = f"the default {shown(default.text)} of {shown(key.text)} is no {parameter.kind.value}"
        way_out = f"write {EXAMPLES[parameter.kind][0]}"
        path = subject.part("parameters", key.text, "default")
        findings.add("ill-typed-argument", message, subject.origin.of(default), help=way_out, path=path)
        default.reported = True
    return parameter


class _Survey:
    """Walks through a template's sections: checks their shape, and finds every parameter in them.

    Attributes:
        bare_words: what stands in conditions without being a parameter or a key.
        is_vague: whether a parameter is named in such a way that it could be any.
    """

    def __init__(
        self, origin: Origin, parameters: Mapping[str, Parameter], meant: Mapping[str, str], findings: Findings
    ) -> None:
        self.patterns: dict[int, Pattern] = {}
        self.touched: set[int] = set()
        self.damaged: dict[tuple[str, str], frozenset[str]] = {}
        self.used: set[str] = set()
        self.is_vague = False
        self._words: set[str] = set()
        self._keys: set[str] = set()
        self._origin = origin
        self._parameters = parameters
        self._meant = meant
        self._findings = findings
        self._path = ""
        self._is_broken = False

    @property
    def bare_words(self) -> frozenset[str]:
        return frozenset(self._words - self._keys)

    def add(self, section: str, elements: MappingNode) -> None:
        """Look at the elements of one section."""
        for key, node in elements.entries.values():
            subject = Subject(section, key, self._origin)
            before, self._is_broken = len(self._findings), False
            if not sound(DEFINITIONS[section], node.data):
                self.damaged[section, key.text] = explain(DEFINITIONS[section], node, subject, self._findings)
            self._path = subject.path
            if self._scalar(key, Position.NAME) | self._node(node, Position.VALUE, section):
                self.touched.add(id(elements))
            if len(self._findings) > before or self._is_broken:
                self.damaged.setdefault((section, key.text), frozenset())

    def _node(self, node: YamlNode, position: Position, section: str) -> bool:
        """Look at a node; return whether it holds a parameter."""
        if isinstance(node, ScalarNode):
            return self._scalar(node, position)
        if isinstance(node, SequenceNode):
            holds = [self._node(item, position, section) for item in node.items]
        else:
            holds = [
                self._scalar(key, Position.NAME) | self._node(value, _position(position, section, key.text), section)
                for key, value in node.entries.values()
            ]
        if any(holds):
            self.touched.add(id(node))
        return any(holds)

    def _scalar(self, node: ScalarNode, position: Position) -> bool:
        text = node.text
        if position is Position.NAME:
            self._keys.add(text)
        elif position is Position.CONDITION:
            self._words.update(_BARE_WORD.findall(text))
        if node.reported or not ("$(" in text or (_MAY_SLIP.search(text) and put_right(text, self._parameters))):
            return False
        letters = letters_of(node, self._origin.source.text)
        for _ in range(MAX_PUT_RIGHT):
            slip = put_right(text, self._parameters)
            if slip is None or not self._may_slip(text, position):
                break
            place = PlacedLetters(self._origin.place, letters).place(slip.start, slip.end) or self._origin.of(node)
            self._report("ill-formed-parameter", slip.message, place, f"write {slip.meant}")
            text, letters = slip.text, ()
        pattern = Pattern(_pieces(text, letters, position, self._meant), position)
        node.reported = True
        right = [self._is_right(node, pattern, index) for index in range(len(pattern.pieces))]
        if all(right):
            node.reported = False
            self.patterns[id(node)] = pattern
            self.touched.add(id(node))
        self._is_broken |= node.reported
        return True

    def _may_slip(self, text: str, position: Position) -> bool:
        """Return whether a damaged parameter is surely one: in a condition and in prose, parentheses are common."""
        return not text.startswith("(") or position not in (Position.CONDITION, Position.TEXT)

    def _is_right(self, node: ScalarNode, pattern: Pattern, index: int) -> bool:
        """Report what is wrong with one piece of a scalar."""
        piece = pattern.pieces[index]
        if not piece.parameter:
            if "$(" in piece.text:
                self.is_vague = True
                message, way_out = "'$(' begins no parameter", "write $(name), without blanks"
                self._report("ill-formed-parameter", message, self._place(node, piece), way_out)
            return "$(" not in piece.text
        self.used.add(piece.parameter)
        parameter = self._parameters.get(piece.parameter)
        if parameter is None:  # which has been reported
            return False
        if parameter.key.reported and pattern.position is Position.CONDITION:
            return False  # nobody knows what would stand there
        known = parameter.kind is not ParameterKind.IDENTIFIER and not parameter.key.reported
        if known and not _may_stand(pattern, index):
            message = f"{shown(piece.parameter)} is no identifier, so that it cannot be part of {shown(node.text)}"
            way_out = "declare it as an identifier, or let it stand alone"
            self._report("parameter-in-name", message, self._place(node, piece), way_out)
            return False
        return True

    def _place(self, node: ScalarNode, piece: Piece) -> Place:
        placed = PlacedLetters(self._origin.place, piece.letters).place(0, len(piece.text))
        return placed or self._origin.of(node)

    def _report(self, rule: str, message: str, place: Place, way_out: str) -> None:
        self._findings.add(rule, message, place, help=way_out, path=self._path)


def _position(position: Position, section: str, key: str) -> Position:
    """Return where the value of a key stands, given where the mapping around it does."""
    if position in (Position.CONDITION, Position.ARGUMENT):
        return position
    if (section, key) in _CONDITION_KEYS:
        return Position.CONDITION
    if (section, key) in (("perception", "with"), ("nodes", "with")):
        return Position.ARGUMENT
    return Position.TEXT if key in _TEXT_KEYS else Position.VALUE


def _pieces(text: str, letters: Letters, position: Position, meant: Mapping[str, str]) -> tuple[Piece, ...]:
    """Return the pieces of a text, its parameters as they are meant."""
    pieces: list[Piece] = []
    at = 0
    for match in PARAMETER.finditer(text):
        start, end = match.span()
        if start > at:
            pieces.append(Piece("", text[at:start], cut(letters, at, start, 0)))
        between = Openings(text[:start]).quote if position is Position.CONDITION else ""
        first = cut(letters, start, start + 1, 0)
        place = ((0, first[0][1], end - start),) if first and first[0][2] == 1 else ()
        pieces.append(Piece(meant.get(match["name"], match["name"]), match[0], place, between))
        at = end
    if at < len(text):
        pieces.append(Piece("", text[at:], cut(letters, at, len(text), 0)))
    return tuple(pieces)


def _may_stand(pattern: Pattern, index: int) -> bool:
    """Return whether a parameter that is no identifier may stand where it does."""
    if pattern.position in (Position.TEXT, Position.ARGUMENT):
        return True
    if pattern.position is not Position.CONDITION:
        return pattern.position is Position.VALUE and pattern.is_whole
    if pattern.pieces[index].between:
        return True
    before = pattern.pieces[index - 1].text[-1] if index else " "
    after = pattern.pieces[index + 1].text[0] if index + 1 < len(pattern.pieces) else " "
    return not (_SOLID.match(before) or _SOLID.match(after))
