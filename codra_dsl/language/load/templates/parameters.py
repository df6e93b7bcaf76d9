"""The mentions of parameters in a template, and corrections of their punctuation and names."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping

from codra_dsl.language.diagnostics import Fix, Place, Related, replacement_fix, surely_means
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.load.schema.misspelt_names import NO_WORDS, misspelt_declarations
from codra_dsl.language.load.yaml.findings import Findings, list_names
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, scalars
from codra_dsl.language.load.yaml.origin import Origin, Subject
from codra_dsl.language.load.yaml.reader import entries
from codra_dsl.language.load.yaml.source_offsets import letter_runs
from codra_dsl.language.model import Letters

MAX_PARAMETER_REPAIRS = 20
"""The maximum number of parameters in one text that are repaired."""

PARAMETER = re.compile(r"\$\((?P<name>[A-Za-z][A-Za-z0-9_]*)\)")

_SPACED_PARAMETER = re.compile(r"\$\((?:\s+(?P<name>[A-Za-z][A-Za-z0-9_]*)\s*|(?P<other>[A-Za-z][A-Za-z0-9_]*)\s+)\)")
_UNCLOSED_PARAMETER = re.compile(r"\$\((?P<name>[A-Za-z][A-Za-z0-9_]*)(?![A-Za-z0-9_)])")
_UNOPENED_PARAMETER = re.compile(r"(?<![\w(])\$?(?P<name>[A-Za-z][A-Za-z0-9_]*)\)")
_FOREIGN_SYNTAX = re.compile(
    r"\$\{\s*(?P<braced>\w+)\s*\}|\{\{\s*(?P<twice>\w+)\s*\}\}|\$(?P<bare>[A-Za-z]\w*)(?!\w*\))"
)
_PARAMETER_WITHOUT_SIGN = re.compile(r"^\((?P<name>[A-Za-z][A-Za-z0-9_]*)\)")


@dataclass(frozen=True, slots=True)
class RepairedParameter:
    """A text with a parameter whose punctuation was repaired.

    Attributes:
        start: the beginning of the parameter in the original text.
        end: the end of the parameter in the original text.
        parameter: the repaired parameter, `$(name)`.
    """

    text: str
    start: int
    end: int
    parameter: str
    message: str


def repair_parameter(text: str, names: Collection[str]) -> RepairedParameter | None:
    """Return a text with its first damaged parameter repaired, or None if nothing can be repaired.

    Damaged parameters are `$( door )`, `$(door`, `door)`, `$door)`, `(door)`, and the syntax of other languages,
    `$door`, `${door}` and `{{ door }}`.
    """
    foreign_match = _FOREIGN_SYNTAX.search(text)
    foreign_name = _leading_name(next(filter(None, foreign_match.groups())), names) if foreign_match is not None else ""
    if foreign_match is not None and (
        foreign_name in foreign_match.groups() or (foreign_name and foreign_match["bare"])
    ):
        end = foreign_match.start("bare") + len(foreign_name) if foreign_match["bare"] else foreign_match.end()
        return _repaired_parameter(
            text,
            foreign_match.start(),
            end,
            foreign_name,
            f"{shown(text[foreign_match.start() : end])} is not a parameter",
        )
    spaced_match = _SPACED_PARAMETER.search(text)
    if spaced_match is not None:
        return _repaired_parameter(
            text,
            *spaced_match.span(),
            spaced_match["name"] or spaced_match["other"],
            f"blanks are not allowed in {shown(spaced_match[0])}",
        )
    unclosed_match = _UNCLOSED_PARAMETER.search(text)
    if unclosed_match is not None:
        name = _leading_name(unclosed_match["name"], names)
        if not name:
            return None
        end = unclosed_match.start("name") + len(name)
        return _repaired_parameter(text, unclosed_match.start(), end, name, f"')' is missing after '$({name}'")
    unopened_match = _UNOPENED_PARAMETER.search(text)
    if unopened_match is not None and unopened_match["name"] in names and text.count("(") < text.count(")"):
        message = f"'$(' is missing before {shown(unopened_match['name'] + ')')}"
        return _repaired_parameter(text, *unopened_match.span(), unopened_match["name"], message)
    bare_match = _PARAMETER_WITHOUT_SIGN.match(text)
    if bare_match is not None and bare_match["name"] in names:
        return _repaired_parameter(
            text, *bare_match.span(), bare_match["name"], f"'$' is missing before {shown(bare_match[0])}"
        )
    return None


def _leading_name(word: str, names: Iterable[str]) -> str:
    """Return the longest name that a word equals or begins with, or an empty text if no name matches."""
    matching_names = (name for name in names if word.startswith(name) and word[len(name) : len(name) + 1] in ("", "_"))
    return max(matching_names, key=len, default="")


def _repaired_parameter(text: str, start: int, end: int, name: str, message: str) -> RepairedParameter:
    parameter = f"$({name})"
    return RepairedParameter(text[:start] + parameter + text[end:], start, end, parameter, message)


@dataclass(frozen=True, slots=True)
class _Mention:
    """A mention of a parameter; `path` leads to the element around it."""

    place: Place
    written: str
    path: str


class ParameterResolver:
    """Resolves the parameters that a template mentions and does not declare.

    Attributes:
        corrections: for each misspelt mention of a parameter, the name that is meant.
        corrected_declarations: for each parameter whose declaration is misspelt, the correct name.
        unresolved_names: names that cannot be resolved.
        undeclared_names: names that uses give and the template mentions, but that the template does not declare.
    """

    def __init__(self, subject: Subject, origin: Origin, sections: Mapping[str, MappingNode]) -> None:
        self.corrections: dict[str, str] = {}
        self.corrected_declarations: dict[str, str] = {}
        self.undeclared_names: set[str] = set()
        self.unresolved_names: set[str] = set()
        self._given_names: frozenset[str] = frozenset()
        self._subject = subject
        self._mentions: dict[str, list[_Mention]] = {}
        for name, mention in _mentions(origin, sections):
            self._mentions.setdefault(name, []).append(mention)

    @property
    def mentioned_names(self) -> frozenset[str]:
        """Return the names of all parameters that the template mentions, with misspelt names corrected."""
        return frozenset(self.corrections.get(name, name) for name in self._mentions)

    def resolve(
        self, declared: Mapping[str, Place], given: Iterable[str], findings: Findings, *, is_open: bool
    ) -> None:
        """Report each unknown parameter once, at the place of the mistake.

        Args:
            declared: the places of the declared parameters, by name.
            given: the names of all arguments in all uses.
            findings: the list to which findings are added.
            is_open: whether there may be parameters with unknown names. An unknown mention may then mean one of these.
        """
        unknown_mentions = {name: mentions for name, mentions in self._mentions.items() if name not in declared}
        if not unknown_mentions:
            return
        arguments = list(given)
        unused_names = [name for name in declared if name not in self._mentions and name not in arguments]
        self._given_names = frozenset(arguments)
        use_counts = {name: len(mentions) + arguments.count(name) for name, mentions in unknown_mentions.items()}
        misspelt_by_used_name = misspelt_declarations(use_counts, unused_names, declared, NO_WORDS, findings.nearest)
        for name, mentions in unknown_mentions.items():
            if name in misspelt_by_used_name:
                self.corrected_declarations[misspelt_by_used_name[name]] = name
                self._report_declaration(
                    misspelt_by_used_name[name], declared[misspelt_by_used_name[name]], name, mentions, findings
                )
            else:
                self._report_uses(name, mentions, declared, findings, is_open=is_open)

    def _report_declaration(
        self, declared: str, place: Place, name: str, mentions: list[_Mention], findings: Findings
    ) -> None:
        message = f"the parameter {shown(declared)} of {self._subject} is never used, and {shown(name)} is not declared"
        path = self._subject.part("parameters", declared)
        related = [Related(f"{shown(name)} is used here", mention.place) for mention in mentions]
        fix = replacement_fix(place, declared, name, safe=False)
        findings.add(
            "unknown-parameter", message, place, help=f"did you mean '{name}'?", path=path, related=related, fix=fix
        )

    def _report_uses(
        self, name: str, mentions: list[_Mention], declared: Mapping[str, Place], findings: Findings, *, is_open: bool
    ) -> None:
        suggestion = None if name in self._given_names else findings.nearest(name, declared)
        if suggestion is not None:
            self.corrections[name] = suggestion
        elif is_open:
            return
        if suggestion is None:
            (self.undeclared_names if name in self._given_names else self.unresolved_names).add(name)
        first, *others = mentions
        default_help = (
            f"declare '{name}' under 'parameters'"
            if name in self._given_names
            else f"parameters are {list_names(declared)}"
        )
        help_text = f"did you mean '{suggestion}'?" if suggestion else default_help
        message = f"unknown parameter {shown(name)} in {self._subject}"
        related = [Related("also here", mention.place) for mention in others]
        fix = None if suggestion is None or others else self._rename_fix(first, name, suggestion, declared)
        findings.add(
            "unknown-parameter", message, first.place, help=help_text, path=first.path, related=related, fix=fix
        )

    def _rename_fix(self, mention: _Mention, name: str, suggestion: str, declared: Iterable[str]) -> Fix | None:
        """Return the fix of a misspelt parameter, if the file contains the mention letter by letter."""
        span = mention.place.span
        if span.line != span.end_line or span.end_column - span.column != len(mention.written):
            return None
        is_safe = suggestion in self._mentions and surely_means(name, suggestion, declared)
        return replacement_fix(mention.place, mention.written, f"$({suggestion})", safe=is_safe)


def _mentions(origin: Origin, sections: Mapping[str, MappingNode]) -> Iterator[tuple[str, _Mention]]:
    for section, elements in sections.items():
        for key, node in entries(elements):
            path = Subject(section, key, origin).path
            for scalar in (scalar for part in (key, node) for scalar in scalars(part, _has_parameter)):
                place = _place_finder(origin, scalar)
                for match in PARAMETER.finditer(scalar.text):
                    yield match["name"], _Mention(place(*match.span()), match[0], path)


def _has_parameter(scalar: ScalarNode) -> bool:
    return "$(" in scalar.text and not scalar.reported


def _place_finder(origin: Origin, scalar: ScalarNode) -> Callable[[int, int], Place]:
    """Return a function that returns the place of a range of a scalar's text."""
    letters = Letters(origin.place, letter_runs(scalar, origin.source.text))
    return lambda start, end: letters.place(start, end) or origin.of(scalar)
