"""The analysis of conditions ends within a budget of counted work, and says if it did not decide."""

from __future__ import annotations

import time
from fractions import Fraction
from pathlib import Path

import pytest

from codra_dsl.compiler import plan_text
from codra_dsl.language.check.conditions.types import Type
from codra_dsl.language.check.graph.cycles import cycles
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.check.solver.budget import Budget, OutOfBudgetError, shared_budget, spend, spend_on_digits
from codra_dsl.language.check.solver.satisfiable import always_holds, can_hold, implies
from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.language.expression import Node, parse
from codra_dsl.language.model import Kind
from codra_dsl.workspace.suppression.rules import OWN_PREFIX
from tests.language.load.texts import loaded

SPEC = """\
codra: 1
name: x
context:
  door: {{type: bool}}
perception:
  look:
    call: robot.door:look
    returns: {{{returns}}}
    accept_when: [{accept_when}]
    identifies: {{door: '{identifies}'}}
"""
HANG_S = 20.0
"""A generous limit of CPU time: without a budget, these attacks take minutes or all memory."""
NUMBER = "x: {type: float, range: [-100, 100]}"


def lint(returns: str, conditions: list[str], identifies: str = "true") -> tuple[Diagnostic, ...]:
    texts = ", ".join(f"'{condition}'" for condition in conditions)
    return codra_lint(SPEC.format(returns=returns, accept_when=texts, identifies=identifies))


def codra_lint(spec: str) -> tuple[Diagnostic, ...]:
    return plan_text(spec, "x.yaml", Path("/")).diagnostics


def members(count: int) -> str:
    return f"{{type: enum, values: [{', '.join(f'm{number}' for number in range(count))}]}}"


def tree(text: str) -> Node:
    node = parse(text)
    assert isinstance(node, Node)
    return node


def work(conditions: list[str], types: dict[str, Type]) -> int:
    budget = Budget(10**9)
    with shared_budget(budget):
        can_hold([tree(condition) for condition in conditions], (), types)
    return 10**9 - budget.remaining_work


def nested_choices(depth: int) -> str:
    text = "x"
    for number in range(depth):
        text = f"({text} if x > {number} else x - {number})"
    return text


def nested_magnitudes(name: str, depth: int) -> str:
    text = name
    for number in range(depth):
        text = f"abs({text} - {number + 1})"
    return text


PRODUCT = " * ".join(["x", *["9e-300"] * 50])
ATTACKS = {
    "two enums in a long list": (f"a: {members(150)}, c: {members(150)}", [f"a in ({', '.join('c' * 600)})"]),
    "choices that double the results at each level": (
        NUMBER,
        [f"{nested_choices(30)} > 1", f"{nested_choices(30)} < 2"],
    ),
    "cuts at each node of the search": (
        ", ".join(f"x{number}: {{type: float, range: [-100, 100]}}" for number in range(10)),
        [
            *(f"{nested_magnitudes(f'x{number}', 7)} > 0.5" for number in range(10)),
            " and ".join(f"x{number} * x{(number + 1) % 10} > 3" for number in range(10)),
        ],
    ),
    "fractions with thousands of digits": (
        f"{NUMBER}, y: {{type: float}}",
        [f"{PRODUCT} + y > {number}" for number in range(40)],
    ),
}


@pytest.mark.parametrize("attack", ATTACKS)
def test_the_work_for_a_spec_is_limited(attack: str) -> None:
    returns, conditions = ATTACKS[attack]

    started_s = time.process_time()
    codes = {finding.code for finding in lint(returns, conditions)}

    assert codes <= {"CDR7105", "CDR7106", "CDR7119"}
    assert time.process_time() - started_s < HANG_S


def test_a_spec_whose_conditions_need_too_much_work_gets_one_finding_at_the_costliest_condition() -> None:
    returns, conditions = ATTACKS["cuts at each node of the search"]

    (finding,) = lint(returns, conditions)

    assert (finding.code, finding.place.span.line, finding.path) == ("CDR7119", 9, "perception.look.accept_when")
    assert "it was not decided" in finding.message
    assert "simplify the condition" in finding.help


def test_an_undecided_question_is_answered_with_possible_and_causes_no_other_finding() -> None:
    types = {"x": Type(Kind.FLOAT)}
    never, always = tree("x > 2 and x < 1"), tree("x > 1 or x <= 1")
    assert not can_hold([never], (), types)
    assert always_holds(always, types)

    with shared_budget(Budget(3)) as budget:
        assert can_hold([never], (), types)
        assert not always_holds(always, types)
        assert not implies([never], [always], types)

    assert budget.has_undecided


def test_wherever_the_budget_ends_the_search_for_cycles_ends_too() -> None:
    condition = "({0} and (known({1}) or not known({1}))) or ({0} and {1})"
    text = "codra: 1\nname: x\ncontext:\n" + "".join(f"  {name}: {{type: bool}}\n" for name in "abc") + "perception:\n"
    for name, need, other in ("abc", "bca", "cab"):
        text += f"  see_{name}: {{call: 'robot:see', returns: {{seen: {{type: bool}}}}, identifies: {{{name}: seen}},\n"
        text += f"    observable_when: ['{condition.format(need, other)}']}}\n"
    spec, _ = loaded(text)
    assert spec is not None
    spec_index = SpecIndex(spec)
    work_limits = range(0, 2000, 20)

    findings_by_limit = {}
    for limit in work_limits:
        with shared_budget(Budget(limit)):
            findings_by_limit[limit] = tuple(cycles(spec_index, FaultyElements()))

    assert findings_by_limit[0] == ()
    (complete,) = findings_by_limit[work_limits[-1]]
    assert complete.message == "context-variables wait for each other: a -> b -> c -> a"
    assert {finding.code for findings in findings_by_limit.values() for finding in findings} == {complete.code}


def test_a_value_of_an_adaptation_that_is_not_decided_is_not_reported_to_leave_its_range() -> None:
    text = nested_choices(20).replace("x", "heat")
    spec = f"""\
codra: 1
name: oven
context:
  heat: {{type: float, range: [0, 40], source: probe, valid_for: forever}}
  count: {{type: float, range: [0, 9], source: adaptation, valid_for: forever}}
agents: {{probe: {{}}}}
adaptation:
  b: {{set: count, value: '50 if {text} > 1 and {text} < 2 else 3'}}
loops:
  round: {{adapt: [b]}}
"""

    assert {finding.code for finding in codra_lint(spec)} == {"CDR7119"}


def test_the_same_spec_has_the_same_findings_in_every_run() -> None:
    returns, conditions = ATTACKS["choices that double the results at each level"]

    assert lint(returns, conditions) == lint(returns, conditions)


def test_the_work_for_two_enums_grows_with_the_sum_of_their_members_and_not_with_the_product() -> None:
    few, many = (
        {name: Type(Kind.ENUM, values=tuple(f"m{number}" for number in range(count))) for name in "ac"}
        for count in (100, 1000)
    )

    assert work(["a == c"], many) < 20 * work(["a == c"], few)


def test_repeated_options_of_in_need_no_further_work() -> None:
    types = {name: Type(Kind.ENUM, values=("open", "closed")) for name in "ac"}

    assert work([f"a in ({', '.join('c' * 300)})"], types) < 2 * work(["a in (c, c)"], types) + 1000


def test_the_cuts_of_a_name_are_computed_once_for_each_search() -> None:
    types = {name: Type(Kind.FLOAT, range=(-100, 100)) for name in ("x", "a", "b", "c")}
    choice = f"{nested_magnitudes('x', 8)} > 0.5"

    split, further = "(a > 1 or a < 0)", "(b > 1 or b < 0) and (c > 1 or c < 0)"
    one = work([f"{split} and {choice} and a * x > 3"], types)
    three = work([f"{split} and {further} and {choice} and a * b * c * x > 3"], types)

    assert three < 3 * one


def test_a_fraction_with_thousands_of_digits_is_no_crash() -> None:
    text = " * ".join(["x", *["9e-300"] * 20])

    assert lint(f"{NUMBER}, y: {{type: float}}", [f"{text} + y > 1", f"{text} + y < 2"]) == ()


def test_long_fractions_cost_more_work_than_short_ones() -> None:
    with shared_budget(Budget(100)) as budget:
        spend_on_digits(Fraction(1, 3), 1e300)
        assert budget.remaining_work == 100
        with pytest.raises(OutOfBudgetError):
            spend_on_digits(Fraction(1, 3**100_000))


def test_work_outside_of_a_question_is_not_limited() -> None:
    spend(10**12)


def test_a_comment_is_not_called_unused_while_a_question_is_undecided() -> None:
    returns, conditions = ATTACKS["choices that double the results at each level"]
    texts = ", ".join(f"'{condition}'" for condition in conditions)
    spec = SPEC.format(returns=returns, accept_when=texts, identifies="true")
    comment = "  # codra: ignore[CDR7105] both limits are kept for the next version\n"

    codes = {finding.code for finding in codra_lint(spec.replace("  look:\n", f"  look:{comment}"))}

    assert "CDR7119" in codes
    assert not any(code.startswith(OWN_PREFIX) for code in codes)
