"""Read FLL: bytes -> an engine or None, and findings. All mistakes are reported in one run, with their places."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import field
from itertools import pairwise
from typing import TypeVar

from codra_dsl.language.diagnostics import Diagnostic, Place, Span, has_errors
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.fuzzy.antecedents import Names, parse_rule
from codra_dsl.language.fuzzy.check import engine_problems
from codra_dsl.language.fuzzy.formulas import parse_formula
from codra_dsl.language.fuzzy.model import (
    Activation,
    AnyTerm,
    Defuzzifier,
    Engine,
    FormulaTerm,
    InputVariable,
    OutputVariable,
    Rule,
    RuleBlock,
    Term,
)
from codra_dsl.language.fuzzy.source import (
    Findings,
    Line,
    Word,
    decode,
    lines,
    parse_natural,
    parse_number,
    parse_quantity,
    shown,
    split,
)
from codra_dsl.language.fuzzy.version5 import convert_from_version_5
from codra_dsl.language.fuzzy.words import (
    FORMULA,
    KEYWORDS,
    Comparator,
    Defuzzification,
    Hedge,
    Method,
    Shape,
    SNorm,
    TNorm,
    Weighting,
)

MAX_RESOLUTION = 100_000
"""The maximum resolution: the number of points at which an output is sampled."""

MAX_RULES_ACTING = 1_000_000
"""The maximum number of rules that an activation may state."""

_T = TypeVar("_T")
_VARIABLE_KEYS = ("description", "enabled", "range", "lock-range", "term")
_KEYS: Mapping[str, tuple[str, ...]] = {
    "Engine": ("description",),
    "InputVariable": _VARIABLE_KEYS,
    "OutputVariable": (*_VARIABLE_KEYS, "aggregation", "defuzzifier", "default", "lock-previous"),
    "RuleBlock": ("description", "enabled", "conjunction", "disjunction", "implication", "activation", "rule"),
}
_REPEATABLE_KEYS = ("term", "rule")
_METHODS_WITH_NUMBER = (Method.FIRST, Method.LAST, Method.HIGHEST, Method.LOWEST)


@dataclass(frozen=True, slots=True)
class Read:
    """The result of reading a text.

    Attributes:
        engine: None if there are errors.
        findings: the findings, in the order of the text.
    """

    engine: Engine | None
    findings: tuple[Diagnostic, ...]


@dataclass(slots=True)
class _Section:
    """The lines of one engine, variable or block, as written."""

    head: Line
    single_values: dict[str, Word] = field(default_factory=dict)
    repeated_lines: list[Line] = field(default_factory=list)


def read_fll(data: bytes, file: str) -> Read:
    """Read an engine of FuzzyLite 6. An engine of FuzzyLite 5 is converted, with a warning.

    Args:
        data: the text in UTF-8.
        file: the name of the file in findings: relative to the project root, with `/`; `-` for standard input.
    """
    findings = Findings()
    text = decode(data, file, findings)
    if text is None:
        return Read(None, findings.all())
    definitions = convert_from_version_5(lines(text, file, findings), findings)
    engine = _Builder(findings, file).engine(_sections(definitions, findings))
    diagnostics = findings.all()
    return Read(None if has_errors(diagnostics) else engine, diagnostics)


def _sections(definitions: Iterable[Line], findings: Findings) -> list[_Section]:
    sections: list[_Section] = []
    for line in definitions:
        if line.key.text in _KEYS:
            sections.append(_Section(line))
        elif not sections:
            message = f"{shown(line.key.text)} comes before any section"
            findings.add("fll-unknown-key", message, line.key.place, "begin with 'Engine: NAME'")
        else:
            _add_line(line, sections[-1], findings)
    return sections


def _add_line(line: Line, section: _Section, findings: Findings) -> None:
    key, kind = line.key, section.head.key.text
    if key.text not in _KEYS[kind]:
        findings.report_unknown("fll-unknown-key", f"key of {kind}", key, (*_KEYS[kind], *_KEYS))
    elif key.text in _REPEATABLE_KEYS:
        section.repeated_lines.append(line)
    elif key.text in section.single_values:
        findings.add("fll-repeated", f"'{key.text}' occurs twice here", key.place, "remove one of them")
    else:
        section.single_values[key.text] = line.value


class _Builder:
    """Builds an engine from sections, and records the places of its parts."""

    def __init__(self, findings: Findings, file: str) -> None:
        self._findings = findings
        self._file = file
        self._places: dict[tuple[object, ...], Place] = {}

    def engine(self, sections: list[_Section]) -> Engine | None:
        """Return the engine, or None after a finding."""
        sections_by_kind: dict[str, list[_Section]] = {kind: [] for kind in _KEYS}
        for section in sections:
            sections_by_kind[section.head.key.text].append(section)
        for other in sections_by_kind["Engine"][1:]:
            self._findings.add("fll-repeated", "a second engine", other.head.key.place, "write one engine per file")
        if not sections_by_kind["Engine"]:
            place = sections[0].head.key.place if sections else Place(Span(self._file, 1, 1, 1, 1))
            self._findings.add("fll-missing", "there is no engine", place, "begin with 'Engine: NAME'")
            return None
        head = sections_by_kind["Engine"][0]
        self._places[("engine",)] = head.head.key.place
        inputs = tuple(self._input(section) for section in sections_by_kind["InputVariable"])
        outputs = tuple(self._output(section) for section in sections_by_kind["OutputVariable"])
        self._report_repeated_names(
            [section.head.value for kind in _KEYS if "Var" in kind for section in sections_by_kind[kind]], "variable"
        )
        output_terms = _terms_by_variable(sections_by_kind["OutputVariable"])
        all_terms = _terms_by_variable(sections_by_kind["InputVariable"]) | output_terms
        blocks = tuple(
            self._block(section, index, all_terms, output_terms)
            for index, section in enumerate(sections_by_kind["RuleBlock"])
        )
        engine = Engine(
            name=head.head.value.text,
            inputs=inputs,
            outputs=outputs,
            blocks=blocks,
            description=self._text(head, "description"),
        )
        self._report_engine_problems(engine)
        return engine

    def _report_engine_problems(self, engine: Engine) -> None:
        if has_errors(self._findings.all()):
            return  # a part that seems to be missing may be one that could not be read
        for problem in engine_problems(engine):
            self._findings.add(problem.rule, problem.message, self._places[problem.location], problem.help)

    def _input(self, section: _Section) -> InputVariable:
        name, (minimum, maximum) = self._name(section.head.value, "variable"), self._range(section)
        self._places[("variable", name)] = section.head.value.place
        return InputVariable(
            name=name,
            minimum=minimum,
            maximum=maximum,
            is_locked=self._flag(section, "lock-range", default=False),
            is_enabled=self._flag(section, "enabled", default=True),
            terms=self._terms(section, name),
            description=self._text(section, "description"),
        )

    def _output(self, section: _Section) -> OutputVariable:
        name, (minimum, maximum) = self._name(section.head.value, "variable"), self._range(section)
        self._places[("variable", name)] = section.head.value.place
        default = section.single_values.get("default")
        value = None if default is None else parse_number(default, self._findings)
        return OutputVariable(
            name=name,
            minimum=minimum,
            maximum=maximum,
            is_locked=self._flag(section, "lock-range", default=False),
            is_enabled=self._flag(section, "enabled", default=True),
            keeps_previous=self._flag(section, "lock-previous", default=False),
            default=None if value is None or value != value else value,
            aggregation=self._choice(section, "aggregation", SNorm),
            defuzzifier=self._defuzzifier(section.single_values.get("defuzzifier")),
            terms=self._terms(section, name),
            description=self._text(section, "description"),
        )

    def _block(self, section: _Section, index: int, all_terms: Names, output_terms: Names) -> RuleBlock:
        self._places[("block", index)] = section.head.key.place
        rules: list[Rule] = []
        for line in section.repeated_lines:
            self._places[("rule", index, len(rules))] = line.value.place
            rule = parse_rule(line.value, all_terms, output_terms, self._findings)
            if rule is not None:
                rules.append(rule)
        return RuleBlock(
            name=section.head.value.text,
            is_enabled=self._flag(section, "enabled", default=True),
            conjunction=self._choice(section, "conjunction", TNorm),
            disjunction=self._choice(section, "disjunction", SNorm),
            implication=self._choice(section, "implication", TNorm),
            activation=self._activation(section.single_values.get("activation")),
            rules=tuple(rules),
            description=self._text(section, "description"),
        )

    def _name(self, word: Word, noun: str) -> str:
        if not word.text:
            self._findings.add("fll-missing", f"a {noun} without a name", word.place, "write its name")
        elif not word.text.isidentifier():
            help = "write letters, digits and underscores, and begin with a letter or underscore"
            self._findings.add("fll-wrong-value", f"{shown(word.text)} is not a name", word.place, help)
        elif word.text in KEYWORDS or word.text in set(Hedge) or word.text == "x":
            help = "choose another name: this is a word of rules or formulas"
            self._findings.add("fll-wrong-value", f"{shown(word.text)} is not a name", word.place, help)
        return word.text

    def _report_repeated_names(self, words: Iterable[Word], noun: str) -> None:
        seen_names: set[str] = set()
        for word in words:
            if word.text in seen_names:
                message = f"a second {noun} {shown(word.text)}"
                self._findings.add("fll-repeated", message, word.place, "rename one of them")
            seen_names.add(word.text)

    def _text(self, section: _Section, key: str) -> str:
        word = section.single_values.get(key)
        return "" if word is None else word.text

    def _flag(self, section: _Section, key: str, *, default: bool) -> bool:
        word = section.single_values.get(key)
        if word is None:
            return default
        if word.text not in ("true", "false"):
            self._findings.add(
                "fll-wrong-value", f"{shown(word.text)} is not a truth value", word.place, "write true or false"
            )
        return word.text == "true"

    def _range(self, section: _Section) -> tuple[float, float]:
        word = section.single_values.get("range")
        ends = [] if word is None else [parse_quantity(end, self._findings) for end in split(word, r"\S+")]
        if word is None or None in ends:
            return (float("-inf"), float("inf"))
        if len(ends) != 2 or not (ends[0] or 0.0) <= (ends[1] or 0.0):
            help = "write the least and the greatest value"
            self._findings.add("fll-wrong-value", f"{shown(word.text)} is not a range", word.place, help)
            return (float("-inf"), float("inf"))
        return (ends[0] or 0.0, ends[1] or 0.0)

    def _choice(self, section: _Section, key: str, kind: Iterable[_T]) -> _T | None:
        return self._word(section.single_values.get(key), key, kind)

    def _word(self, word: Word | None, noun: str, kind: Iterable[_T]) -> _T | None:
        if word is None or word.text in ("", "none"):
            return None
        members_by_text = {str(member): member for member in kind}
        if word.text not in members_by_text:
            self._findings.report_unknown("fll-unknown-word", noun, word, members_by_text)
        return members_by_text.get(word.text)

    def _defuzzifier(self, word: Word | None) -> Defuzzifier | None:
        words = [] if word is None else list(split(word, r"\S+"))
        method = self._word(words[0], "defuzzifier", Defuzzification) if words else None
        if method is None:
            return None
        self._expect_end(words[2:])
        if len(words) == 1:
            return Defuzzifier(method=method)
        if method.is_weighted:
            weighting = self._word(words[1], "weighting", Weighting)
            return Defuzzifier(method=method, weighting=weighting or Weighting.AUTOMATIC)
        resolution = parse_natural(words[1], MAX_RESOLUTION, self._findings)
        if resolution == 0:
            self._findings.add("fll-wrong-value", "the resolution is 0", words[1].place, "write at least 1")
        return Defuzzifier(method=method, resolution=resolution or 1)

    def _activation(self, word: Word | None) -> Activation | None:
        words = [] if word is None else list(split(word, r"\S+"))
        method = self._word(words[0], "activation", Method) if words else None
        if method is None:
            return None
        activation = Activation(method=method)
        if method is Method.THRESHOLD and len(words) == 3:
            comparator = self._word(words[1], "comparator", Comparator)
            threshold = parse_quantity(words[2], self._findings)
            return Activation(method=method, comparator=comparator or Comparator.MORE, threshold=threshold or 0.0)
        if method in _METHODS_WITH_NUMBER and len(words) > 1:
            rules = parse_natural(words[1], MAX_RULES_ACTING, self._findings)
            has_threshold = method in (Method.FIRST, Method.LAST) and len(words) == 3
            threshold = parse_quantity(words[2], self._findings) if has_threshold else 0.0
            self._expect_end(words[3 if has_threshold else 2 :])
            return Activation(method=method, rules=rules or 0, threshold=threshold or 0.0)
        self._expect_end(words[1:])
        return activation

    def _expect_end(self, words: list[Word]) -> None:
        if words:
            self._findings.add("fll-wrong-value", f"unexpected {shown(words[0].text)}", words[0].place, "remove it")

    def _terms(self, section: _Section, variable: str) -> tuple[AnyTerm, ...]:
        terms = [self._term(line, variable) for line in section.repeated_lines]
        self._report_repeated_names([line.words()[0] for line in section.repeated_lines if line.words()], "term")
        return tuple(term for term in terms if term is not None)

    def _term(self, line: Line, variable: str) -> AnyTerm | None:
        words = line.words()
        if len(words) < 2:
            help = "write 'term: NAME SHAPE PARAMETERS'"
            self._findings.add("fll-wrong-term", "a term without name or shape", line.key.place, help)
            return None
        name = self._name(words[0], "term")
        self._places["term", variable, name] = words[0].place
        if words[1].text == FORMULA:
            return self._formula(name, line.value, words)
        if words[1].text not in Shape.__members__:
            self._findings.report_unknown("fll-unknown-word", "shape", words[1], (*Shape.__members__, FORMULA))
            return None
        shape = Shape[words[1].text]
        values = [parse_quantity(word, self._findings) for word in words[2:]]
        term_numbers = tuple(value for value in values if value is not None)
        return self._shaped_term(name, shape, term_numbers, words[1]) if len(term_numbers) == len(values) else None

    def _formula(self, name: str, value: Word, words: tuple[Word, ...]) -> FormulaTerm | None:
        if len(words) == 2:
            self._findings.add("fll-wrong-formula", "a function without a formula", words[1].place, "write one")
            return None
        offset = words[2].place.span.column - value.place.span.column
        text = Word(value.text[offset:], words[2].place)
        formula = parse_formula(text, self._findings)
        return None if formula is None else FormulaTerm(name=name, text=" ".join(text.text.split()), formula=formula)

    def _shaped_term(self, name: str, shape: Shape, term_numbers: tuple[float, ...], word: Word) -> Term | None:
        form = shape.value
        if shape is Shape.Linear:
            return Term(name=name, shape=shape, parameters=term_numbers)
        if shape is Shape.Discrete:
            return self._discrete_term(name, term_numbers, word)
        count = len(form.names)
        if len(term_numbers) == count:
            return Term(name=name, shape=shape, parameters=term_numbers)
        if form.has_height and len(term_numbers) == count + 1:
            return Term(name=name, shape=shape, parameters=term_numbers[:-1], height=term_numbers[-1])
        help = f"write {', '.join(form.names)}" + (", and optionally a height" if form.has_height else "")
        self._findings.add("fll-wrong-term", f"{len(term_numbers)} numbers for {shape.name}", word.place, help)
        return None

    def _discrete_term(self, name: str, term_numbers: tuple[float, ...], word: Word) -> Term | None:
        height = term_numbers[-1] if len(term_numbers) % 2 else 1.0
        points = term_numbers[: len(term_numbers) // 2 * 2]
        if not points or not all(abs(value) < float("inf") for value in points):
            self._findings.add("fll-wrong-term", "no finite points", word.place, "write x y pairs")
        elif any(left > right for left, right in pairwise(points[::2])):
            self._findings.add("fll-wrong-term", "points out of order", word.place, "sort the pairs by x")
        else:
            return Term(name=name, shape=Shape.Discrete, parameters=points, height=height)
        return None


def _terms_by_variable(sections: Iterable[_Section]) -> dict[str, frozenset[str]]:
    """Return a mapping from each declared variable to its terms.

    Terms that could not be read are included, so that a mistake in a term causes no findings in rules.
    """
    return {
        section.head.value.text: frozenset(line.words()[0].text for line in section.repeated_lines if line.words())
        for section in sections
    }
