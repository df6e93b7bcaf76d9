"""Wrong FLL: every finding has a place, a message and help, and all findings come at once."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.language.diagnostics import Severity
from codra_dsl.language.fuzzy import compile_engine, read_fll, write_fll
from codra_dsl.language.fuzzy.model import Activation
from codra_dsl.language.fuzzy.source import MAX_BYTES, MAX_FINDINGS, MAX_LINES
from codra_dsl.language.fuzzy.words import Method, TNorm
from tests.language.fuzzy.engines import FOLDER, NAMES, loaded, stored

GOOD = """\
Engine: fan
InputVariable: heat
  enabled: true
  range: 0.0 1.0
  lock-range: false
  term: cold Ramp 0.6 0.1
  term: hot Ramp 0.4 0.9
OutputVariable: speed
  enabled: true
  range: 0.0 10.0
  lock-range: false
  aggregation: Maximum
  defuzzifier: Centroid 100
  default: nan
  lock-previous: false
  term: slow Triangle 0.0 2.0 4.0
  term: fast Triangle 6.0 8.0 10.0
RuleBlock: only
  enabled: true
  conjunction: Minimum
  disjunction: Maximum
  implication: Minimum
  activation: General
  rule: if heat is cold then speed is slow
  rule: if heat is hot or heat is not cold then speed is fast with 0.5
"""


def finding_texts(text: str | bytes) -> list[str]:
    """Return the findings as `line:column name: message`."""
    data = text if isinstance(text, bytes) else text.encode()
    findings = read_fll(data, "fan.fll").findings
    for finding in findings:
        assert finding.help
        assert finding.place.span.file == "fan.fll"
    places = [f"{finding.place.span.line}:{finding.place.span.column}" for finding in findings]
    return [f"{place} {finding.rule.name}: {finding.message}" for place, finding in zip(places, findings, strict=True)]


def test_a_good_engine_has_no_findings_and_is_written_back() -> None:
    engine = read_fll(GOOD.encode(), "fan.fll").engine

    assert finding_texts(GOOD) == []
    assert engine is not None
    assert write_fll(engine) == GOOD


MISTAKES = [
    ("  range: 0.0 1.0", "  range: 1.0 0.0", "4:10 fll-wrong-value: '1.0 0.0' is not a range"),
    ("  range: 0.0 1.0", "  range: 0.0", "4:10 fll-wrong-value: '0.0' is not a range"),
    ("  range: 0.0 1.0", "  range: 0.0 one", "4:14 fll-wrong-value: 'one' is not a number"),
    ("  range: 0.0 1.0", "  range: 0.0 nan", "4:14 fll-wrong-value: nan is not allowed here"),
    ("  range: 0.0 1.0", "  rnge: 0.0 1.0", "4:3 fll-unknown-key: unknown key of InputVariable 'rnge'"),
    ("  range: 0.0 1.0", "  range 0.0 1.0", "4:3 fll-no-definition: 'range 0.0 1.0' is not 'key: value'"),
    ("  enabled: true\n  range: 0.0 1.0", "  enabled: yes", "3:12 fll-wrong-value: 'yes' is not a truth value"),
    ("cold Ramp 0.6 0.1", "cold Rmp 0.6 0.1", "6:14 fll-unknown-word: unknown shape 'Rmp'"),
    ("cold Ramp 0.6 0.1", "cold Ramp 0.6", "6:14 fll-wrong-term: 1 numbers for Ramp"),
    ("cold Ramp 0.6 0.1", "cold Ramp 0.6 0.1 1.0 2.0", "6:14 fll-wrong-term: 4 numbers for Ramp"),
    ("cold Ramp 0.6 0.1", "cold Ramp 0.6 nan", "6:23 fll-wrong-value: nan is not allowed here"),
    ("cold Ramp 0.6 0.1", "cold Discrete 0.5 1.0 0.1 0.0", "6:14 fll-wrong-term: points out of order"),
    ("cold Ramp 0.6 0.1", "cold Discrete", "6:14 fll-wrong-term: no finite points"),
    ("cold Ramp 0.6 0.1", "cold Linear 1 2 3", "6:9 fll-wrong-term: 3 coefficients for 1 inputs"),
    ("cold Ramp 0.6 0.1", "cold Function", "6:14 fll-wrong-formula: a function without a formula"),
    ("cold Ramp 0.6 0.1", "cold Function sin(x", "6:26 fll-wrong-formula: '(' is unmatched"),
    ("cold Ramp 0.6 0.1", "cold Function 1 +", "6:25 fll-wrong-formula: '+' lacks operands"),
    ("cold Ramp 0.6 0.1", "cold Function x x", "6:23 fll-wrong-formula: this is not one formula"),
    ("cold Ramp 0.6 0.1", "cold Function x + $", "6:27 fll-wrong-formula: '$' is not an operand"),
    ("cold Ramp 0.6 0.1", "cold Function x + z", "6:9 fll-unknown-name: unknown variable 'z' in the formula"),
    ("cold Ramp 0.6 0.1", "cold", "6:3 fll-wrong-term: a term without name or shape"),
    ("cold Ramp 0.6 0.1", "cold Ramp 0.6 0.1\n  term: cold Ramp 0 1", "7:9 fll-repeated: a second term 'cold'"),
    ("cold Ramp 0.6 0.1", "cold Ramp 0.6 0.1\n  term: very Ramp 0 1", "7:9 fll-wrong-value: 'very' is not a name"),
    ("Variable: heat", "Variable: my heat\nInputVariable: heat", "2:16 fll-wrong-value: 'my heat' is not a name"),
    ("  aggregation: Maximum\n", "", "8:17 fll-missing: an integral needs an aggregation"),
    ("  aggregation: Maximum", "  aggregation: Minimum", "12:16 fll-unknown-word: unknown aggregation 'Minimum'"),
    ("  defuzzifier: Centroid 100\n", "", "8:17 fll-missing: the output has no defuzzifier"),
    ("Centroid 100", "Centroid 0", "13:25 fll-wrong-value: the resolution is 0"),
    ("Centroid 100", "Centroid many", "13:25 fll-wrong-value: 'many' is not a count"),
    ("Centroid 100", "Centroid 100 3", "13:29 fll-wrong-value: unexpected '3'"),
    ("  range: 0.0 10.0\n", "", "8:17 fll-missing: an integral needs a finite range"),
    ("  activation: General\n", "", "18:1 fll-missing: the block has no activation"),
    (
        "  aggregation: Maximum",
        "  accumulation: Maximum",
        "12:3 fll-version-5: an engine of FuzzyLite 5: it is read as if it were converted to version 6",
    ),
    ("  activation: General", "  activation: Minimum", "23:15 fll-unknown-word: unknown activation 'Minimum'"),
    ("  activation: General", "  activation: Frist", "23:15 fll-unknown-word: unknown activation 'Frist'"),
    ("  activation: General", "  activation: Threshold ~ 1", "23:25 fll-unknown-word: unknown comparator '~'"),
    ("  disjunction: Maximum\n", "", "18:1 fll-missing: 'or' needs a disjunction"),
    ("  implication: Minimum\n", "", "18:1 fll-missing: 'then' needs an implication"),
    ("if heat is cold", "when heat is cold", "24:9 fll-wrong-rule: expected 'if', found 'when'"),
    ("if heat is cold", "if hat is cold", "24:12 fll-unknown-name: unknown variable 'hat'"),
    ("if heat is cold", "if heat is cool", "24:20 fll-unknown-name: unknown term of 'heat' 'cool'"),
    ("if heat is cold", "if heat cold", "24:17 fll-wrong-rule: expected 'is', found 'cold'"),
    ("if heat is cold", "if heat is then", "24:20 fll-wrong-rule: expected a term, found 'then'"),
    ("if heat is cold", "if (heat is cold", "24:12 fll-wrong-rule: '(' is never closed"),
    ("if heat is cold", "if heat is cold)", "24:24 fll-wrong-rule: ')' closes nothing"),
    ("speed is slow", "speed = slow", "24:36 fll-wrong-rule: expected 'is', found '='"),
    ("speed is slow", "heat is cold", "24:30 fll-unknown-name: unknown output 'heat'"),
    ("speed is slow", "speed is", "24:9 fll-wrong-rule: the rule ends too early"),
    ("speed is slow", "speed is slow or", "24:44 fll-wrong-rule: unexpected 'or'"),
    ("with 0.5", "with -0.5", "25:68 fll-wrong-value: '-0.5' is not a weight"),
    ("with 0.5", "with 0.5 0.5", "25:72 fll-wrong-rule: unexpected '0.5'"),
    ("Engine: fan\n", "", "1:1 fll-missing: there is no engine"),
    ("Engine: fan\n", "name: fan\nEngine: fan\n", "1:1 fll-unknown-key: 'name' comes before any section"),
    ("Engine: fan\n", "Engine: fan\nEngine: fun\n", "2:1 fll-repeated: a second engine"),
]


@pytest.mark.parametrize(("old", "new", "expected"), MISTAKES, ids=[expected for _, _, expected in MISTAKES])
def test_a_mistake_is_reported_once_at_its_place(old: str, new: str, expected: str) -> None:
    assert GOOD.count(old) >= 1
    assert finding_texts(GOOD.replace(old, new, 1)) == [expected]


def test_a_sign_in_place_of_a_keyword_is_replaced_and_a_missing_keyword_is_added() -> None:
    (sign,) = read_fll(GOOD.replace("speed is slow", "speed = slow", 1).encode(), "fan.fll").findings
    (nothing,) = read_fll(GOOD.replace("speed is slow", "speed slow", 1).encode(), "fan.fll").findings

    assert (sign.help, nothing.help) == ("write 'is' instead", "write 'is' before it")


def of_version_5(text: str) -> str:
    """Return an engine as FuzzyLite 5 writes it."""
    text = text.replace("aggregation:", "accumulation:").replace("lock-previous:", "lock-valid:")
    return text.replace("  implication: Minimum\n", "").replace("activation: General", "activation: Minimum")


def test_an_engine_of_fuzzylite_5_is_read_as_that_of_version_6_and_reported_once() -> None:
    read = read_fll(of_version_5(GOOD).encode(), "old.fll")

    assert read.engine is not None
    assert read.engine == read_fll(GOOD.encode(), "fan.fll").engine
    (finding,) = read.findings
    assert (finding.rule.name, finding.severity) == ("fll-version-5", Severity.WARNING)
    assert finding.place.span.line == of_version_5(GOOD).splitlines().index("  accumulation: Maximum") + 1
    assert finding.help == (
        "in version 6, write 'aggregation' for 'accumulation'; 'lock-previous' for 'lock-valid'; "
        "'implication: Minimum' and 'activation: General' for 'activation: Minimum'"
    )


def test_an_engine_of_fuzzylite_5_without_a_norm_for_conclusions_has_general_activation() -> None:
    old = of_version_5(GOOD).replace("activation: Minimum", "activation: none")
    old = old.replace("Centroid 100", "WeightedAverage TakagiSugeno")
    engine = read_fll(old.encode(), "old.fll").engine

    assert engine is not None
    assert engine.blocks[0].implication is None
    assert engine.blocks[0].activation == Activation(method=Method.GENERAL)


def test_an_engine_with_words_of_both_versions_and_without_activation_is_read() -> None:
    mixed = GOOD.replace("aggregation:", "accumulation:").replace("  activation: General\n", "")
    two_blocks = mixed + mixed[mixed.index("RuleBlock:") :].replace("only", "other")
    engine = read_fll(two_blocks.encode(), "mixed.fll").engine

    assert engine is not None
    assert [block.activation for block in engine.blocks] == [Activation(method=Method.GENERAL)] * 2
    assert [block.implication for block in engine.blocks] == [TNorm.MINIMUM] * 2


def test_mistakes_in_an_engine_of_fuzzylite_5_are_reported_beside_its_version() -> None:
    assert [text.split()[1] for text in finding_texts(of_version_5(GOOD).replace("heat is cold", "heat is cool"))] == [
        "fll-version-5:",
        "fll-unknown-name:",
    ]


def test_tsukamoto_needs_monotone_terms() -> None:
    assert finding_texts(GOOD.replace("Centroid 100", "WeightedSum Tsukamoto")) == [
        "16:9 fll-unfit-term: 'slow' is not monotone",
        "17:9 fll-unfit-term: 'fast' is not monotone",
    ]


def test_the_weighting_is_required_for_terms_of_several_kinds() -> None:
    text = GOOD.replace("Centroid 100", "WeightedSum").replace("Triangle 0.0 2.0 4.0", "Constant 2.0")

    assert finding_texts(text) == ["8:17 fll-unfit-term: rules conclude terms of several kinds"]


def test_all_mistakes_are_reported_at_once() -> None:
    text = GOOD.replace("Rmp", "").replace("cold Ramp", "cold Rump").replace("Centroid", "Centre")
    text = text.replace("is hot or", "is hat or").replace("General", "Generel")

    assert [finding.split()[1] for finding in finding_texts(text)] == [
        "fll-unknown-word:",
        "fll-unknown-word:",
        "fll-unknown-word:",
        "fll-unknown-name:",
    ]


def test_corrections_of_misspelt_words_are_suggested() -> None:
    helps = {
        new: read_fll(GOOD.replace(old, new).encode(), "fan.fll").findings[0].help
        for old, new in (("Ramp 0.6", "Rmp 0.6"), ("Centroid", "Centriod"), ("heat is hot", "heat is hto"))
    }

    assert helps == {
        "Rmp 0.6": "did you mean 'Ramp'?",
        "Centriod": "did you mean 'Centroid'?",
        "heat is hto": "did you mean 'hot'?",
    }


HOSTILE = [
    (b"\xff\xfe", "1:1 fll-unreadable"),
    (b"Engine: a\n\xc3", "2:1 fll-unreadable"),
    (b"a" * (MAX_BYTES + 1), "1:1 fll-too-large"),
    (b"\n" * MAX_LINES, "1:1 fll-too-large"),
    (b"Engine: a\nRuleBlock:\nrule: " + b"if " * 5000, "3:1 fll-too-large"),
    (b"Engine: a\nRuleBlock:\nrule: if " + b"(" * 500, "3:50 fll-too-large"),
    (b"Engine: a\nInputVariable: v\nterm: t Function " + b"(" * 400 + b"x" + b")" * 400, "3:18 fll-too-large"),
    (b"Engine: a\nInputVariable: v\nterm: t Function " + b"~" * 300 + b"x", "3:18 fll-too-large"),
    (b"", "1:1 fll-missing"),
    (b"\0", "1:1 fll-missing"),
]


@pytest.mark.parametrize(("data", "expected"), HOSTILE)
def test_hostile_text_is_refused_with_a_place(data: bytes, expected: str) -> None:
    assert finding_texts(data)[0].startswith(expected)


def nested(parentheses: int, joined: int) -> str:
    """Return an antecedent with nested parentheses. Each parenthesis is the first of some operands in a row."""
    text = "heat is hot"
    for _ in range(parentheses):
        text = f"({text}{' and heat is not cold' * joined})"
    return text


@pytest.mark.parametrize(
    ("rule", "is_read"),
    [
        (f"if heat is {'not ' * 100}hot then speed is fast", True),
        (f"if heat is {'not ' * 101}hot then speed is fast", False),
        (f"if {nested(25, 3)} and heat is {'very ' * 95}hot then speed is {'somewhat ' * 100}fast", True),
        (f"if {nested(25, 5)} then speed is fast", False),
        (f"if heat is hot then speed is {'very ' * 101}fast", False),
    ],
)
def test_python_can_compile_the_deepest_accepted_rule(rule: str, is_read: bool) -> None:
    lines = GOOD.splitlines()
    at = next(number for number, line in enumerate(lines) if line.startswith("  rule: "))
    read = read_fll("\n".join([*lines[:at], f"  rule: {rule}", *lines[at + 1 :]]).encode(), "fan.fll")

    if is_read:
        assert read.engine is not None
        compile(compile_engine(read.engine), "fan.py", "exec")
    else:
        assert [(finding.code, finding.place.span.line) for finding in read.findings] == [("CDR2202", at + 1)]


def test_findings_are_bounded() -> None:
    assert len(finding_texts("Engine: a\n" + "x\n" * 5000)) == MAX_FINDINGS


@settings(max_examples=75, deadline=None)
@given(st.binary(max_size=300) | st.text(max_size=300).map(lambda text: text.encode("utf-8", "replace")))
def test_any_bytes_can_be_read(data: bytes) -> None:
    read = read_fll(data, "fan.fll")

    assert (read.engine is None) == bool(read.findings)


@settings(max_examples=50, deadline=None)
@given(name=st.sampled_from(NAMES), seed=st.integers(0, 10_000))
def test_a_damaged_engine_is_refused_with_places_or_works(name: str, seed: int) -> None:
    """Lines and words are removed, doubled and swapped. An accepted engine compiles, runs and can be written."""
    chance = random.Random(seed)
    lines = (FOLDER / f"{name}.fll").read_text("utf-8").splitlines()
    for _ in range(chance.randint(1, 3)):
        at = chance.randrange(len(lines))
        words = lines[at].split(" ")
        other = chance.choice(lines).split(" ")
        kind = chance.randrange(4)
        if kind == 0:
            del lines[at]
        elif kind == 1:
            lines.insert(at, chance.choice(lines))
        elif kind == 2:
            words[chance.randrange(len(words))] = chance.choice(other)
            lines[at] = " ".join(words)
        else:
            del words[chance.randrange(len(words))]
            lines[at] = " ".join(words)
    read = read_fll("\n".join(lines).encode(), "fan.fll")
    if read.engine is None:
        assert read.findings
        assert all(1 <= finding.place.span.line <= len(lines) + 1 for finding in read.findings)
    else:
        loaded(read.engine).infer(*[0.5] * len(read.engine.inputs))
        assert read_fll(write_fll(read.engine).encode(), "fan.fll").engine == read.engine


@pytest.mark.parametrize("name", NAMES)
def test_the_same_engine_gives_the_same_module(name: str) -> None:
    engine = stored(name)

    assert compile_engine(engine) == compile_engine(stored(name))


def test_engines_may_use_names_of_python() -> None:
    text = GOOD.replace("heat", "lambda").replace("speed", "outputs").replace("cold", "class").replace("fast", "größe")
    module = loaded_text(text)

    assert module.infer(0.9).values[0] == pytest.approx(8.0)


def loaded_text(text: str) -> object:
    engine = read_fll(text.encode(), "fan.fll").engine
    assert engine is not None
    return loaded(engine)
