"""The table of FuzzyLite's constructs: whether each is supported, and which engines have reference values for it.

`python -m tests.language.fuzzy.constructs` prints the table of docs/reference/fuzzy.md.
"""

from __future__ import annotations

import json
from collections.abc import Iterator

from codra_dsl.language.fuzzy.formulas import FUNCTIONS, OPERATORS
from codra_dsl.language.fuzzy.model import And, Antecedent, Call, Engine, Formula, FormulaTerm, Or, propositions
from codra_dsl.language.fuzzy.words import FORMULA, Defuzzification, Hedge, Method, Shape, SNorm, TNorm
from tests.language.fuzzy.engines import FOLDER, NAMES, stored

SUPPORTED = {
    "term": {*Shape.__members__, FORMULA},
    "T-norm": set(map(str, TNorm)),
    "S-norm": set(map(str, SNorm)),
    "hedge": set(map(str, Hedge)),
    "activation": set(map(str, Method)),
    "defuzzifier": set(map(str, Defuzzification)),
    "formula": {*OPERATORS, *FUNCTIONS},
}


def known_words() -> list[tuple[str, str]]:
    """Return every word of FuzzyLite in FLL, with its kind."""
    words_by_kind = json.loads((FOLDER / "constructs.json").read_text("utf-8"))
    return [(kind, word) for kind, words in words_by_kind.items() for word in words]


def used_words(engine: Engine) -> Iterator[tuple[str, str]]:
    """Yield the words that an engine uses, with their kinds."""
    for variable in engine.variables:
        for term in variable.terms:
            if isinstance(term, FormulaTerm):
                yield "term", FORMULA
                yield from (("formula", word) for word in calls(term.formula))
            else:
                yield "term", term.shape.name
    for output in engine.outputs:
        yield "S-norm", str(output.aggregation)
        yield "defuzzifier", str(output.defuzzifier and output.defuzzifier.method)
    for block in engine.blocks:
        yield "activation", str(block.activation and block.activation.method)
        yield "T-norm", str(block.implication)
        for rule in block.rules:
            for part in (*propositions(rule.antecedent), *rule.conclusions):
                yield from (("hedge", str(hedge)) for hedge in part.hedges)
            kinds = set(joints(rule.antecedent))
            if And in kinds:
                yield "T-norm", str(block.conjunction)
            if Or in kinds:
                yield "S-norm", str(block.disjunction)


def joints(part: Antecedent) -> Iterator[type]:
    if isinstance(part, And | Or):
        yield type(part)
        yield from joints(part.left)
        yield from joints(part.right)


def calls(formula: Formula) -> Iterator[str]:
    if isinstance(formula, Call):
        yield formula.function
        for operand in formula.operands:
            yield from calls(operand)


def engines_by_word() -> dict[tuple[str, str], list[str]]:
    """Return the engines that use each word."""
    engine_names_by_word: dict[tuple[str, str], list[str]] = {}
    for name in NAMES:
        for word in sorted(set(used_words(stored(name)))):
            engine_names_by_word.setdefault(word, []).append(name)
    return engine_names_by_word


def table() -> str:
    """Return the table, with one row per word."""
    tested = engines_by_word()
    rows = ["| kind | word | supported | tested by the values of |", "|---|---|---|---|"]
    for kind, word in known_words():
        answer = "yes" if word in SUPPORTED[kind] else "refused"
        rows.append(f"| {kind} | `{word}` | {answer} | {', '.join(tested.get((kind, word), ['nothing']))} |")
    return "\n".join(rows) + "\n"


if __name__ == "__main__":
    print(table(), end="")
