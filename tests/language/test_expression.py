from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.language.expression import (
    FUNCTIONS,
    MAX_DEPTH,
    MAX_LENGTH,
    WORDS,
    And,
    Arithmetic,
    Comparison,
    In,
    Name,
    Negative,
    Node,
    Not,
    Number,
    Or,
    SyntaxProblem,
    Text,
    is_name,
    names_in,
    parse,
    parse_derivation,
    parse_over_context,
    parts,
    to_text,
    walk,
)
from tests.language.condition_trees import AT, NAMES, TREES, compare, name, number


def parsed(text: str) -> Node:
    node = parse(text)
    assert not isinstance(node, SyntaxProblem), node
    return node


def problem(text: str) -> SyntaxProblem:
    answer = parse(text)
    assert isinstance(answer, SyntaxProblem), answer
    return answer


PIECES = st.sampled_from(
    [
        *NAMES,
        *WORDS,
        *FUNCTIONS,
        *Comparison,
        *"()+-*/,.=!%$'\"[]",
        "5 m",
        "0.5",
        "1e3",
        "&&",
        "is",
        "AND",
        '"x"',
        "ä",
        "\\",
    ]
)


@given(TREES)
def test_the_printed_form_parses_to_the_same_tree(tree: Node) -> None:
    again = parse(to_text(tree))
    assert again == tree or (isinstance(again, SyntaxProblem) and "too deep" in again.message)


@given(TREES)
def test_printing_again_gives_the_same_text(tree: Node) -> None:
    assert to_text(parsed(to_text(tree))) == to_text(tree)


@given(TREES, st.sampled_from(["{}", "({})", "  {} ", "{}\n"]))
def test_blanks_and_parentheses_around_a_condition_are_ignored(tree: Node, frame: str) -> None:
    assert parsed(frame.format(to_text(tree))) == tree


@given(TREES)
def test_parts_have_their_offsets(tree: Node) -> None:
    text = to_text(tree)
    for node in walk(parsed(text)):
        assert all(node.start <= part.start < part.end <= node.end for part in parts(node))
        if isinstance(node, Name):
            assert text[node.start : node.end] == node.name


@given(st.text(max_size=40))
def test_any_text_gives_a_tree_or_a_problem(text: str) -> None:
    check_answer(text)


@settings(max_examples=75)
@given(st.lists(PIECES, max_size=14), st.sampled_from(["", " "]))
def test_any_pieces_of_conditions_give_a_tree_or_a_problem(pieces: list[str], between: str) -> None:
    check_answer(between.join(pieces))


def check_answer(text: str) -> None:
    answer = parse(text)
    if isinstance(answer, SyntaxProblem):
        assert 0 <= answer.start <= answer.end <= len(text)
        assert answer.message
        assert answer.help
        assert answer.message.isprintable()
    else:
        assert parse(to_text(answer)) == answer


@pytest.mark.parametrize(
    ("text", "tree"),
    [
        (
            "a or b and not s",
            Or(operands=(name("a"), And(operands=(name("b"), Not(operand=name("s"), **AT)), **AT)), **AT),
        ),
        ("not a == b", Not(operand=compare(name("a"), ("==", name("b"))), **AT)),
        ("0 < a <= 5 m", compare(number(0), ("<", name("a")), ("<=", number(5, "m")))),
        ("-a * b", Arithmetic(operator="*", left=Negative(operand=name("a"), **AT), right=name("b"), **AT)),
        ("5 m/s", number(5, "m/s")),
        ("5 m / s", Arithmetic(operator="/", left=number(5, "m"), right=name("s"), **AT)),
        ("5 min", number(5, "min")),
        ("5min", number(5, "min")),
        ("2 1/s", number(2, "1/s")),
        ("'it\\'s'", Text(value="it's", **AT)),
        ("a not in (1, 2,)", In(item=name("a"), options=(number(1), number(2)), negated=True, **AT)),
    ],
)
def test_conditions_read_as_in_python(text: str, tree: Node) -> None:
    assert parsed(text) == tree


def test_choices_chain_to_the_right_and_differences_to_the_left() -> None:
    assert to_text(parsed("1 if a else (2 if b else 3)")) == "1 if a else 2 if b else 3"
    assert to_text(parsed("(1 if a else 2) if b else 3")) == "(1 if a else 2) if b else 3"
    assert to_text(parsed("(5 - 3) - 1")) == "5 - 3 - 1"
    assert to_text(parsed("5 - (3 - 1)")) == "5 - (3 - 1)"


def test_a_number_is_an_int_only_if_it_is_written_as_one() -> None:
    integer, real = parsed("3"), parsed("3.0")
    assert isinstance(integer, Number)
    assert isinstance(real, Number)
    assert (type(integer.value), type(real.value)) == (int, float)


def test_equality_of_trees_ignores_offsets() -> None:
    assert parsed("a   and (b)") == parsed("a and b")
    assert hash(parsed("a   and (b)")) == hash(parsed("a and b"))


def test_names_are_listed_in_the_order_of_the_text() -> None:
    condition = parsed("b > 1 if known(a) else max(s, m) in (h, V)")
    assert [mention.name for mention in names_in(condition)] == ["b", "a", "s", "m", "h", "V"]


@pytest.mark.parametrize(
    ("text", "where", "message", "help_text"),
    [
        ("a = 3", "=", "'=' is not an operator", "write '==' to compare"),
        ("a && b", "&&", "'&&' is not an operator", "write 'and'"),
        ("a || b", "||", "'||' is not an operator", "write 'or'"),
        ("!a", "!", "'!' is not an operator", "write 'not'"),
        ("a is 3", "is", "'is' is not an operator", "write '==', '!=' or '<'; only fuzzy rules have 'is'"),
        ("a AND b", "AND", "'AND' is not an operator", "write 'and'"),
        ("a === 3", "===", "'===' is not an operator", "write '=='"),
        ("a =< 3", "=<", "'=<' is not an operator", "write '<='"),
        ("a <> 3", "<>", "'<>' is not an operator", "write '!='"),
        ("a ≥ 3", "≥", "'≥' is not an operator", "write '>='"),
        ("a ? b : s", "?", "'?' is not an operator", "write A if CONDITION else B"),
        ("a in [1, 2]", "[", "'[' is not an operator", "list the allowed values in parentheses, such as x in (1, 2)"),
        ("a in b", "b", "a list is missing after 'in'", "write x in (1, 2) or x == 1"),
        ("a in ()", "a in ()", "the list after 'in' is empty", "list the allowed values: x in (1, 2)"),
        (
            "a.b",
            ".",
            "'.' is not an operator",
            "write a name without '.'; a member is compared, as in door == \"open\"",
        ),
        ("(a and b", "(", "'(' is never closed", "add ')'"),
        ("a and b)", ")", "')' closes nothing", "remove it or add '('"),
        (")", ")", "')' closes nothing", "remove it"),
        ("a and", "and", "a value is missing after 'and'", "complete the condition"),
        ("a > < b", ">", "a value is missing after '>'", "add a value before '<'"),
        ("> 3", ">", "a value is missing before '>'", "begin the condition with a value"),
        ("a == not b", "not", "'not' needs parentheses here", "write (not x)"),
        (
            "a < b in (1, 2)",
            "in",
            "'in' cannot be part of a chain of comparisons",
            "put one of the comparisons in parentheses or join them with 'and'",
        ),
        (
            "a, b",
            ",",
            "unexpected ','",
            "join the conditions with 'and' or 'or'; or write each condition as an item of its own",
        ),
        ("(a, b)", "(a,", "a list is allowed only after 'in'", "write x in (1, 2)"),
        ("'open' if a", "if", "'if' without 'else'", "write A if CONDITION else B"),
        ("if a then b", "if", "unexpected 'if'", "write A if CONDITION else B"),
        (
            "c and a else 5 m < 6 m",
            "a else 5 m",
            "'x else y' is allowed only in 'derived'",
            "remove 'else': while a returned value is absent, the result is rejected",
        ),
        (
            "1 if a else 5 m < 6 m else 2",
            "a else 5 m",
            "'x else y' is allowed only in 'derived'",
            "remove 'else': while a returned value is absent, the result is rejected",
        ),
        (
            "a for 5 s",
            "for",
            "a condition cannot state for how long it must hold",
            "declare in 'context' a bool {type: bool, held: a, for: 5 s}, and write its name here",
        ),
        (
            "a > 3 for 500 ms and b",
            "for",
            "a condition cannot state for how long it must hold",
            "declare in 'context' a bool {type: bool, held: BOOL, for: 500 ms}, and write its name here; "
            "BOOL is a variable with this condition under 'derived'",
        ),
        ("", "", "the condition is empty", "write a condition such as x > 3"),
        (
            "a b",
            "b",
            "an operator is missing before 'b'",
            "join conditions with 'and' or 'or', compare values with '==' or '<'",
        ),
        (
            "a not b",
            "not",
            "an operator is missing before 'not'",
            "join conditions with 'and' or 'or', compare values with '==' or '<'",
        ),
        ("absolute(a)", "absolute", "unknown function 'absolute'", "functions are abs, age, known, max, min"),
        ("knwon(a)", "knwon", "unknown function 'knwon'", "did you mean 'known'?"),
        ("minimum(a, b)", "minimum", "unknown function 'minimum'", "did you mean 'min'?"),
        ("unknown(a)", "unknown", "unknown function 'unknown'", "write not known(x)"),
        ("known a", "known", "'known' is a function", "write known(...)"),
        ("known('a')", "'a'", "known() takes one name", "write known(NAME), without quotes or operators"),
        ("age(a, b)", "age(a, b)", "age() takes one value, not 2", "write age(x)"),
        ("min(a)", "min(a)", "min() takes at least 2 values, not 1", "write min(a, b)"),
        ("a > 5 degrees", "degrees", "unknown unit 'degrees'", "did you mean 'deg'?"),
        (
            "a > 5 m/b",
            "m/b",
            "unknown unit 'm/b'",
            "write blanks around '/' for an operation; without blanks, '/' is part of a unit",
        ),
        ("a > 5 %", "%", "'%' is not a unit", "did you mean 'percent'?"),
        ("a > 010", "010", "'010' is not a number", "write 10"),
        ("a > .5", ".5", "'.5' is not a number", "write 0.5"),
        ("a > 5.", "5.", "'5.' is not a number", "write 5 or 5.0"),
        ("a > 1_000", "1_000", "'1_000' is not a number", "write 1000"),
        ("a > 1e200", "1e200", "the number '1e200' is too large", "at most 1e100 is allowed"),
        ("a == 'open", "'open", "the quote ' is never closed", "add ' after the text"),
        (
            "a == 'o\\pen'",
            "\\p",
            "unknown escape '\\p'",
            "a backslash is allowed only before a quote, a backslash, n or t; write \\\\ for a backslash",
        ),
        ("a == “open”", "“", "'“' is not an operator", "quote with \" or '"),
        ("True", "True", "'True' is not a name", "write 'true'"),
        ("a == None", "None", "'None' is not a name", "use known(x) to test whether a context-variable is known"),
        ("a == null", "null", "'null' is not a name", "use known(x) to test whether a context-variable is known"),
        ("lambda > 3", "lambda", "'lambda' is not a name", "it is a reserved word and cannot be a name"),
        (
            "tür > 3",
            "tür",
            "'tür' is not a name",
            "names hold only letters A to Z, digits and '_', and start with a letter",
        ),
        ("a > $(b)", "$", "'$' is not an operator", "parameters are written $(name), and only inside a template"),
        (
            "a\N{NO-BREAK SPACE}and b",
            "\N{NO-BREAK SPACE}",
            "'\\xa0' is not part of a condition",
            "write an ordinary blank",
        ),
    ],
)
def test_a_common_mistake_is_reported_with_help(text: str, where: str, message: str, help_text: str) -> None:
    answer = problem(text)
    assert (answer.message, text[answer.start : answer.end], answer.help) == (message, where, help_text)


@pytest.mark.parametrize(
    "text",
    [
        "(" * (MAX_DEPTH + 1) + "a" + ")" * (MAX_DEPTH + 1),
        "not " * (MAX_DEPTH + 1) + "a",
        " < ".join(["a"] * (MAX_DEPTH + 2)),
        "-" * 1900 + "a",
        "+".join("a" * 900),
        "1 if a else " * 100 + "2",
        "(((" * 600,
        "abs(" * 200 + "a",
    ],
)
def test_nesting_has_a_limit(text: str) -> None:
    assert problem(text).message == "the condition is nested too deeply"


def test_length_has_a_limit() -> None:
    answer = problem("a" * (MAX_LENGTH + 1))
    assert (answer.start, answer.message) == (MAX_LENGTH, f"a condition of {MAX_LENGTH + 1} characters is too long")
    assert parsed("a" * MAX_LENGTH)


@pytest.mark.parametrize(
    ("parse_text", "item"), [(parse_derivation, "count() + "), (parse_over_context, "distance() < 1 m or ")]
)
def test_a_text_that_is_too_long_is_refused_before_its_functions_of_the_graph_are_read(
    parse_text: Callable[[str], Node | SyntaxProblem], item: str
) -> None:
    answer = parse_text(item * MAX_LENGTH)
    assert isinstance(answer, SyntaxProblem)
    assert answer.message == f"a condition of {len(item) * MAX_LENGTH} characters is too long"


def test_a_long_conjunction_is_not_deep() -> None:
    condition = parsed(" and ".join(["a"] * 300))
    assert isinstance(condition, And)
    assert len(condition.operands) == 300


@pytest.mark.parametrize(
    "text", ["and", "known", "true", "null", "class", "_a", "1a", "", "a b", "ä", "a\n", "a" * 3000]
)
def test_reserved_and_ill_formed_words_are_not_names(text: str) -> None:
    assert not is_name(text)


@pytest.mark.parametrize("text", ["a", "centrifuge_base_in_FOV", "x1", "andy", "known_", "True_"])
def test_other_words_are_names(text: str) -> None:
    assert is_name(text)
    assert parsed(text) == name(text)
