"""Hostile fuzzy engines in FLL: derivations of its grammar, and the engines of this repository, with damage."""

from __future__ import annotations

import math
import re
from pathlib import Path
from random import Random

from codra_dsl.language.fuzzy import compile_engine, read_fll, write_fll
from codra_dsl.language.fuzzy.formulas import FUNCTIONS, OPERATORS
from codra_dsl.language.fuzzy.words import (
    Comparator,
    Defuzzification,
    Hedge,
    Method,
    Shape,
    SNorm,
    TNorm,
    Weighting,
)
from tests.campaigns.hostile.damage import damaged, encoded
from tests.campaigns.hostile.reading import Answer, Files, Kind
from tests.campaigns.hostile.texts import NAMES, NUMBERS, ODD_NAMES, RESERVED_NAMES

ROOT = Path(__file__).parents[3]
_FILES = tuple(path.read_text("utf-8") for path in sorted((ROOT / "tests/data/fuzzy").glob("*.fll")))
_PAGES = tuple(
    block
    for page in ("docs/reference/fuzzy.md", "docs/reference/adaptation.md")
    for block in re.findall(r"```text[^\n]*\n(Engine:.*?)```", (ROOT / page).read_text("utf-8"), re.DOTALL)
)
_SMALL_FILES = tuple(text for text in (*_FILES, *_PAGES) if len(text) < 3000)
_MAX_COMPUTED = 2_000
"""The largest number of points times rules for which an engine is also computed."""


class _Grammar:
    """Derives an engine; `wild` is the probability with which a part is hostile."""

    def __init__(self, chance: Random) -> None:
        self.chance = chance
        self.wild = chance.choice((0.0, 0.01, 0.1))
        self.inputs = [self.name(f"in{number}") for number in range(chance.choice((0, 1, 2, 3)))]
        self.outputs = [self.name(f"out{number}") for number in range(chance.choice((1, 1, 2)))]
        self.terms = [self.name(name) for name in ("low", "middle", "high")]

    def engine(self) -> str:
        parts = [f"Engine: {self.name('any')}\n"]
        parts += [self.variable("InputVariable", name) for name in self.inputs]
        parts += [self.variable("OutputVariable", name) for name in self.outputs]
        parts += [self.block() for _ in range(self.chance.choice((1, 1, 2)))]
        if self.chance.random() < self.wild:
            self.chance.shuffle(parts)
        return "".join(parts)

    def name(self, tame: str) -> str:
        return self.chance.choice((*NAMES, *ODD_NAMES[:60], *RESERVED_NAMES)) if self.is_wild() else tame

    def is_wild(self) -> bool:
        return self.chance.random() < self.wild

    def number(self) -> str:
        if self.is_wild():
            return self.chance.choice(NUMBERS)
        return (
            repr(round(self.chance.uniform(-1, 2), 3))
            if self.chance.random() < 0.9
            else self.chance.choice(NUMBERS[:9])
        )

    def word(self, *words: str) -> str:
        return self.chance.choice((*NAMES, "none", "")) if self.is_wild() else self.chance.choice(words)

    def variable(self, kind: str, name: str) -> str:
        chance = self.chance
        lines = [f"{kind}: {name}", f"  enabled: {self.word('true', 'true', 'true', 'false')}"]
        lines.append(f"  range: {self.number() if self.is_wild() else '-1'} {self.number() if self.is_wild() else '2'}")
        lines.append(f"  lock-range: {self.word('true', 'false')}")
        is_weighted = chance.random() < 0.4
        if kind == "OutputVariable":
            methods = [str(method) for method in Defuzzification if method.is_weighted == is_weighted]
            argument = self.word(*map(str, Weighting)) if is_weighted else self.word("1", "7", "100")
            argument = self.number() if self.is_wild() else argument
            lines += [
                f"  aggregation: {self.word(*map(str, SNorm))}",
                f"  defuzzifier: {self.word(*methods)} {argument}",
                f"  default: {self.word('nan', self.number())}",
                f"  lock-previous: {self.word('true', 'false')}",
            ]
        lines += [f"  term: {term} {self.shape(is_weighted and kind == 'OutputVariable')}" for term in self.terms]
        return "\n".join(lines) + "\n"

    def shape(self, is_weighted: bool) -> str:
        if self.chance.random() < (0.5 if is_weighted else 0.05):
            return f"Function {self.formula(4)}" if self.chance.random() < 0.6 else f"Constant {self.number()}"
        shapes = [shape for shape in Shape if shape.value.is_monotone or not is_weighted]
        shape = self.chance.choice(shapes)
        count = len(shape.value.names) or self.chance.choice((2, 4, 6))
        count += (
            self.chance.choice((-1, 1, 2, 300))
            if self.is_wild()
            else self.chance.choice((0, 0, 0, 1)) * shape.value.has_height
        )
        return f"{shape.name} {' '.join(self.number() for _ in range(count))}"

    def formula(self, depth: int) -> str:
        if self.is_wild():
            return self.chance.choice(
                ("(" * 300, "x" * 5000, "sin(" * 100, "~" * 300 + "x", "x + " * 400 + "x", "x(x)", ")")
            )
        kind = self.chance.random()
        if depth == 0 or kind < 0.3:
            return self.chance.choice((*self.inputs, "x", self.number().lstrip("-+")))
        if kind < 0.6:
            function = self.chance.choice(sorted(FUNCTIONS))
            return f"{function}({', '.join(self.formula(depth - 1) for _ in range(FUNCTIONS[function]))})"
        operator = self.chance.choice(sorted(OPERATORS))
        first = "" if OPERATORS[operator].operands == 1 else f"{self.formula(depth - 1)} "
        return f"({first}{operator} {self.formula(depth - 1)})"

    def block(self) -> str:
        method = self.word(*map(str, Method))
        arguments = {"First": "1 0.5", "Last": "1 0.5", "Highest": "2", "Lowest": "2"}.get(method, "")
        if method == "Threshold":
            arguments = f"{self.word(*map(str, Comparator))} {self.number()}"
        lines = [
            f"RuleBlock: {self.name('rules')}",
            f"  conjunction: {self.word(*map(str, TNorm))}",
            f"  disjunction: {self.word(*map(str, SNorm))}",
            f"  implication: {self.word(*map(str, TNorm))}",
            f"  activation: {method} {self.number() if self.is_wild() else arguments}",
        ]
        lines += [f"  rule: {self.rule()}" for _ in range(self.chance.choice((1, 3, 6)))]
        return "\n".join(lines) + "\n"

    def rule(self) -> str:
        conclusion = " and ".join(self.proposition(self.outputs) for _ in range(self.chance.choice((1, 1, 2))))
        weight = f" with {self.number()}" if self.chance.random() < 0.2 else ""
        return f"if {self.antecedent(3)} then {conclusion}{weight}"

    def antecedent(self, depth: int) -> str:
        if self.is_wild():
            return self.chance.choice(("(" * 300, "not " * 300, " and ".join(["a is b"] * 500), "is", ""))
        if depth == 0 or self.chance.random() < 0.5:
            return self.proposition([*self.inputs, *self.outputs[:1]])
        inner = f"{self.antecedent(depth - 1)} {self.chance.choice(('and', 'or'))} {self.antecedent(depth - 1)}"
        return f"({inner})" if self.chance.random() < 0.5 else inner

    def proposition(self, variables: list[str]) -> str:
        hedges = "".join(f"{self.chance.choice(list(Hedge))} " for _ in range(self.chance.choice((0, 0, 0, 1, 2))))
        return f"{self.chance.choice(variables)} is {hedges}{self.chance.choice(self.terms)}"


def _make(chance: Random) -> Files:
    kind = chance.random()
    text = _Grammar(chance).engine() if kind < 0.7 else chance.choice(_FILES if kind > 0.98 else _SMALL_FILES)
    if kind > 0.3:
        text = damaged(chance, text)
    if chance.random() < 0.01:
        text = text * chance.choice((100, 2000)) + "#" * 1_000_000
    return {"engine.fll": encoded(chance, text)}


def _read(root: Path) -> Answer:
    """Read an engine, write it, read it again, compile it, and compute it for odd numbers."""
    read = read_fll((root / "engine.fll").read_bytes(), "engine.fll")
    codes = tuple(finding.code for finding in read.findings)
    for finding in read.findings:
        assert finding.message.isprintable(), finding.message
    if read.engine is None:
        assert codes, "the engine is refused without a finding"
        return Answer(False, codes)
    again = read_fll(write_fll(read.engine).encode(), "engine.fll")
    assert repr(again.engine) == repr(read.engine), "the engine differs after writing and reading"
    names: dict[str, object] = {}
    exec(compile(compile_engine(read.engine), "<frozen engine>", "exec", dont_inherit=True), names)
    rules = sum(len(block.rules) for block in read.engine.blocks)
    points = sum(0 if output.defuzzifier is None else output.defuzzifier.resolution for output in read.engine.outputs)
    if points * max(rules, 1) <= _MAX_COMPUTED:
        for number in (0.5, -1e308, math.inf):
            names["infer"](*[number] * len(read.engine.inputs))  # type: ignore[operator]
    return Answer(True, codes)


ENGINES = Kind(_make, _read)
