"""Build elements of MAPE-K loops: nodes -> values of the model. Keys that cannot be read get their default."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import pairwise
from typing import TypeVar

from codra_dsl.language.diagnostics import suggest
from codra_dsl.language.expression import Name, Text, names_in, parse_over_context
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.fuzzy.model import Term
from codra_dsl.language.fuzzy.words import Defuzzification, Shape, SNorm, TNorm
from codra_dsl.language.load.elements.conditions import condition_text, read_condition
from codra_dsl.language.load.yaml.names import check_name
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, SequenceNode, YamlNode
from codra_dsl.language.load.yaml.reader import Reader, entries
from codra_dsl.language.model import (
    Adaptation,
    Condition,
    Course,
    FuzzyTerm,
    HardRule,
    Inference,
    LeafTasks,
    Letters,
    Loop,
    Method,
    Output,
    Parameter,
    Phrase,
    Rate,
    RateKind,
    Reference,
    Repeat,
    TreeElement,
    Worse,
)

Word = TypeVar("Word", TNorm, SNorm, Defuzzification)


def snake_case(word: str) -> str:
    """Return a word of FuzzyLite in the spelling of specs."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", word).lower()


SHAPES = {
    "s_shape" if shape is Shape.SShape else "z_shape" if shape is Shape.ZShape else snake_case(shape.name): shape
    for shape in Shape
    if shape is not Shape.Linear
}
"""The shapes of terms by their names in specs; `Linear`, the coefficients of inputs, is allowed only in FLL."""


def read_rate(reader: Reader) -> Rate | None:
    """Return the rate, the share or the held bool that a context-variable declares, or None."""
    kind = next((kind for kind in RateKind if kind.value in reader.node.entries), None)
    if kind is None:
        return None
    if not _is_text(reader.node.entries[kind.value][1]):  # the loops may compute the variable, so it may have a source
        reader.damage(kind.value)
        reader.damage("source")
        return None
    counts = reader.scalar("counts")
    return Rate(
        of=_read_reference(reader, kind.value),
        over_s=reader.duration_s("for" if kind is RateKind.HELD else "over", 0.0),
        is_falling=counts is not None and counts.text == "falling",
        kind=kind,
    )


def build_metric(reader: Reader) -> Output:
    """Return a metric."""
    return _build_output(reader)


def build_action(reader: Reader) -> Output:
    """Return an action."""
    return _build_output(reader)


def _build_output(reader: Reader) -> Output:
    return Output(
        name=reader.subject.name,
        place=reader.place,
        label=reader.text("label", ""),
        description=reader.text("description", ""),
        worse=reader.choice("worse", Worse.LOW),
        hold_s=reader.duration_s("hold", 0.0, least="zero") if "hold" in reader.node.entries else None,
        rules=tuple(_read_phrases(reader, "rules")),
        terms=read_terms(reader),
        method=Method(
            inference=reader.choice("inference", Inference.MAMDANI),
            conjunction=_read_word(reader, "conjunction", TNorm.MINIMUM),
            disjunction=_read_word(reader, "disjunction", SNorm.MAXIMUM),
            implication=_read_word(reader, "implication", TNorm.MINIMUM),
            aggregation=_read_word(reader, "aggregation", SNorm.MAXIMUM),
            defuzzifier=_read_word(reader, "defuzzifier", Defuzzification.CENTROID)
            if "defuzzifier" in reader.node.entries
            else None,
        ),
        places=reader.places(),
    )


def build_adaptation(reader: Reader) -> Adaptation:
    """Return an adaptation. With `set`, or with `value` and without `choose`, it sets a variable."""
    keys = reader.node.entries.keys()
    is_parameter = "set" in keys or ("value" in keys and "choose" not in keys)
    does = _read_parameter(reader) if is_parameter else _read_course(reader)
    return Adaptation(
        name=reader.subject.name,
        place=reader.place,
        does=does,
        label=reader.text("label", ""),
        dwell_s=reader.duration_s("dwell", 0.0, least="zero"),
        places=reader.places(),
    )


def build_tree(reader: Reader) -> TreeElement:
    """Return a behaviour tree."""
    return TreeElement(
        name=reader.subject.name,
        place=reader.place,
        file=_read_reference(reader, "file"),
        label=reader.text("label", ""),
        agent=_read_reference(reader, "agent") if "agent" in reader.node.entries else None,
        course=tuple(_read_branches(reader)),
        leaves=tuple(_read_leaves(reader)),
        period_s=reader.duration_s("period", 0.1),
        repeat=reader.choice("repeat", Repeat.ALWAYS),
        places=reader.places(),
    )


def build_loop(reader: Reader) -> Loop:
    """Return a loop."""
    return Loop(
        name=reader.subject.name,
        place=reader.place,
        label=reader.text("label", ""),
        monitor=reader.references("monitor"),
        analyse=reader.references("analyse"),
        adapt=reader.references("adapt"),
        execute=reader.references("execute"),
        period_s=reader.duration_s("period", 1.0),
        places=reader.places(),
    )


def read_terms(reader: Reader) -> tuple[FuzzyTerm, ...]:
    """Return the linguistic terms of a variable, a metric or a weight."""
    return tuple(_read_terms(reader))


def _read_terms(reader: Reader) -> Iterator[FuzzyTerm]:
    for key, node in entries(reader.node.value("terms")):
        is_valid = check_name(key, "a term", reader.subject, reader.findings, "terms")
        if not is_valid or node.reported or not isinstance(node, ScalarNode):
            reader.damage("terms")
            continue
        term = _read_term(reader, key.text, node)
        if term is not None:
            yield FuzzyTerm(term=term, text=node.text, place=reader.origin.of(node))


def _read_term(reader: Reader, name: str, node: ScalarNode) -> Term | None:
    word, *texts = node.text.split() or [""]
    shape = SHAPES.get(word)
    if shape is None:
        suggestion = suggest(word, SHAPES)
        help_text = f"did you mean '{suggestion}'?" if suggestion else f"shapes are {', '.join(SHAPES)}"
        _report(reader, name, node, f"{shown(word)} is not a shape of a term", help_text)
        return None
    numbers = [_parse_number(text) for text in texts]
    if None in numbers:
        _report(reader, name, node, f"{shown(node.text)} is not a shape followed by numbers", _shape_help(word, shape))
        return None
    values = tuple(number for number in numbers if number is not None)
    parameter_count = len(shape.value.names)
    if shape is Shape.Discrete:
        is_valid = len(values) >= 4 and len(values) % 2 == 0
        height = 1.0
    else:
        has_height = shape.value.has_height and len(values) == parameter_count + 1
        is_valid, height = len(values) == parameter_count or has_height, values[-1] if has_height else 1.0
        values = values[:parameter_count]
    if not is_valid or not all(map(math.isfinite, (*values, height))):
        _report(
            reader,
            name,
            node,
            f"{shown(node.text)} does not have the numbers that its shape needs",
            _shape_help(word, shape),
        )
        return None
    fault, hint = _fault(shape, values)
    if fault:
        _report(reader, name, node, f"{shown(node.text)} {fault}", f"{_shape_help(word, shape)}{hint}")
        return None
    return Term(name=name, shape=shape, parameters=values, height=height)


def _fault(shape: Shape, values: tuple[float, ...]) -> tuple[str, str]:
    """Return why the numbers of a term do not make a valid shape, and a hint, or two empty texts if nothing is wrong.

    There are as many numbers as the shape needs. From invalid numbers, FuzzyLite would compute 0 or NaN.
    """
    ordered_values = values[::2] if shape is Shape.Discrete else values if shape in _SHAPES_WITH_ORDERED_CORNERS else ()
    if any(one > other for one, other in pairwise(ordered_values)):
        return "has its numbers out of order", " from left to right"
    for name, value in zip(shape.value.names, values, strict=False):
        if name.startswith(("width", "standard_deviation")) and value <= 0.0:
            return "has no width", f", {name.upper()} above 0"
    if shape is Shape.Ramp and values[0] == values[1]:
        return "begins where it ends", "; a step is 'binary START DIRECTION'"
    return "", ""


_SHAPES_WITH_ORDERED_CORNERS = {Shape.Triangle, Shape.Trapezoid, Shape.PiShape, Shape.SShape, Shape.ZShape}
"""The shapes whose corners must be in order from left to right."""


def _report(reader: Reader, name: str, node: ScalarNode, message: str, help_text: str) -> None:
    reader.fail("fuzzy-term", message, node, help_text, "terms", name)


def _shape_help(word: str, shape: Shape) -> str:
    names = " ".join(name.upper() for name in shape.value.names) or "X1 Y1 X2 Y2 ..."
    return f"write '{word} {names}' with numbers"


def _parse_number(text: str) -> float | None:
    try:
        return float(text) if re.fullmatch(r"[+-]?[0-9.]+(?:[eE][+-]?[0-9]+)?", text) else None
    except ValueError:
        return None


def _read_word(reader: Reader, key: str, default: Word) -> Word:
    """Return a word of FuzzyLite, which specs spell in lower case."""
    node = reader.scalar(key)
    words: dict[str, Word] = {snake_case(word.value): word for word in type(default)}
    return words.get(node.text, default) if node is not None else default


def _read_phrases(reader: Reader, key: str) -> Iterator[Phrase]:
    node = reader.node.value(key)
    for item in node.items if isinstance(node, SequenceNode) else ():
        if item.reported or not isinstance(item, ScalarNode) or not isinstance(item.data, str):
            reader.damage(key)
            continue
        text, letters = condition_text(reader, item)
        placed_letters = Letters(reader.place_of, letters) if letters else None
        yield Phrase(text=text, place=reader.origin.of(item), letters=placed_letters)


def _read_course(reader: Reader) -> Course:
    return Course(
        choose=reader.references("choose"),
        within=_read_reference(reader, "in"),
        otherwise=_read_reference(reader, "otherwise"),
        node=_read_reference(reader, "of") if "of" in reader.node.entries else None,
        smooth_s=reader.duration_s("smooth", 0.0, least="zero"),
        lead=_read_lead(reader),
        hold_s=reader.duration_s("hold", 0.0, least="zero"),
        cooldown_s=reader.duration_s("cooldown", 0.0, least="zero"),
        abort_s=reader.duration_s("abort", 2.0),
        always=tuple(_read_hard_rules(reader)),
    )


def _read_lead(reader: Reader) -> float:
    node = reader.scalar("lead")
    number = node.data if node is not None else None
    return float(number) if isinstance(number, int | float) and not isinstance(number, bool) else 0.0


def _read_hard_rules(reader: Reader) -> Iterator[HardRule]:
    node = reader.node.value("always")
    for index, item in enumerate(node.items if isinstance(node, SequenceNode) else ()):
        if item.reported or not isinstance(item, MappingNode):
            reader.damage("always")
            continue
        rule_reader = reader.inner(item, "always", str(index))
        condition_node = item.value("if")
        if condition_node is None or rule_reader.scalar("then") is None:
            reader.damage("always")
            continue
        condition = read_condition(rule_reader, condition_node, "if", grammar=parse_over_context)
        for_s = rule_reader.duration_s("for", 0.0)
        yield HardRule(condition=condition, action=_read_reference(rule_reader, "then"), for_s=for_s)


def _read_parameter(reader: Reader) -> Parameter:
    node = reader.node.value("value")
    empty_condition = Condition(text="", tree=None, place=reader.place)
    value = empty_condition if node is None else read_condition(reader, node, "value", grammar=parse_over_context)
    return Parameter(variable=_read_reference(reader, "set"), value=value, otherwise=_read_otherwise(reader))


def _read_otherwise(reader: Reader) -> Condition | None:
    """Return the constant under `otherwise`, or None. A single word is a text, such as a member."""
    node = reader.node.value("otherwise")
    if node is None:
        return None
    condition = read_condition(reader, node, "otherwise", grammar=parse_over_context)
    tree = condition.tree
    if isinstance(tree, Name) and not tree.pose_comparison:
        return replace(condition, tree=Text(start=tree.start, end=tree.end, value=tree.name))
    if tree is not None and names_in(tree):
        help_text = "write a value that does not depend on context, such as '0.3 m/s': context can be unknown"
        reader.fail("condition-syntax", f"{shown(condition.text)} is not a constant", node, help_text, "otherwise")
        return replace(condition, tree=None)
    return condition


def _read_branches(reader: Reader) -> Iterator[tuple[Reference, Reference]]:
    for key, node in entries(reader.node.value("course")):
        if _is_text(node) and not key.reported:
            yield reader.reference(key), Reference(name=_text(node), place=reader.origin.of(node))
        else:
            reader.damage("course")


def _read_leaves(reader: Reader) -> Iterator[LeafTasks]:
    for key, node in entries(reader.node.value("leaves")):
        items: Iterable[YamlNode] = node.items if isinstance(node, SequenceNode) else ()
        if key.reported or node.reported or not isinstance(node, SequenceNode) or not all(map(_is_text, items)):
            reader.damage("leaves")
            continue
        tasks = tuple(Reference(name=_text(item), place=reader.origin.of(item)) for item in items)
        yield LeafTasks(leaf=reader.reference(key), tasks=tasks)


def _is_text(node: YamlNode) -> bool:
    return isinstance(node, ScalarNode) and not node.reported and isinstance(node.data, str)


def _text(node: YamlNode) -> str:
    return node.text if isinstance(node, ScalarNode) else ""


def _read_reference(reader: Reader, key: str) -> Reference:
    node = reader.scalar(key)
    if node is None or not isinstance(node.data, str):
        reader.damage(key)
        return Reference(name="", place=reader.place)
    return reader.reference(node)
