"""Which decisions of a main execution a spec covers, and which of its variables no decision needs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from codra_dsl.generation.build_plan import BuildPlan
from codra_dsl.language.check import CheckedSpec
from codra_dsl.language.diagnostics import Diagnostic, Place, Related, Rule, Severity
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.graph import closure
from codra_dsl.language.model import Variable
from codra_dsl.tooling.main_execution.model import Decision, MainExecution

_NOT_COVERED = Rule(code="decision-not-covered", name="decision-not-covered", severity=Severity.WARNING)
_NOT_USED = Rule(code="variable-without-decision", name="variable-without-decision", severity=Severity.WARNING)


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgedDecision:
    """The decisions of one skill on one variable, and whether the spec covers them.

    Attributes:
        decision: the first of these decisions in the source.
        places: the places of all of them.
        variable: the variable of the spec; empty if it has none.
        reason: why the decision is not covered; empty if it is covered.
    """

    decision: Decision
    places: tuple[Place, ...]
    variable: str
    reason: str

    @property
    def is_covered(self) -> bool:
        """Whether context can answer the decision."""
        return not self.reason


@dataclass(frozen=True, slots=True, kw_only=True)
class Coverage:
    """What a spec covers of a main execution.

    Attributes:
        spec: the name of the spec.
        decisions: all decisions, in the order of the source.
        unused_variables: the variables that neither a decision, nor a loop or an agent, nor the perception of another
            used variable needs.
    """

    spec: str
    decisions: tuple[JudgedDecision, ...]
    unused_variables: tuple[Variable, ...]

    @property
    def covered_count(self) -> int:
        """The number of covered decisions."""
        return sum(judged.is_covered for judged in self.decisions)

    @property
    def covered_percent(self) -> float:
        """The share of covered decisions; 100 if there is no decision."""
        return 100 * self.covered_count / len(self.decisions) if self.decisions else 100.0

    def findings(self) -> tuple[Diagnostic, ...]:
        """Return a warning for each decision that is not covered, and for each variable without a decision."""
        uncovered = (_finding(judged) for judged in self.decisions if not judged.is_covered)
        unused = (
            Diagnostic(
                rule=_NOT_USED,
                message=f"no decision of the main execution needs '{variable.name}'",
                place=variable.place,
                path=f"context.{variable.name}",
                help="remove it, or check the skill and the name under which the main execution decides on it",
            )
            for variable in self.unused_variables
        )
        return (*uncovered, *unused)


def coverage_of(plan: BuildPlan, main_execution: MainExecution) -> Coverage:
    """Return what a spec covers of a main execution.

    A decision is covered if the spec has its variable, and the skill of the same name previews or monitors it. If the
    spec has no skill of this name, any skill may do so. The variable of a decision has the name that a draft would give
    it, or a text that the source passes when it asks, or has one of these as its label.
    """
    variables = _variables_by_name(plan.checked)
    groups: dict[tuple[str, str], list[Decision]] = {}
    for decision in main_execution.decisions:
        if decision.is_made:
            groups.setdefault((decision.name, decision.skill), []).append(decision)
    judged_decisions = tuple(_judge(group, variables, plan.checked) for group in groups.values())
    decided_names = {judged.variable for judged in judged_decisions if judged.variable}
    used_names = _needed(decided_names | _other_uses(plan.checked), plan.checked)
    unused = (
        variable
        for name, variable in plan.checked.variables.items()
        if name not in used_names and not variable.is_derived and variable.pose_condition is None
    )
    return Coverage(spec=plan.name, decisions=judged_decisions, unused_variables=tuple(unused))


def _variables_by_name(checked: CheckedSpec) -> Mapping[str, str]:
    """Return a mapping from names and labels, in lower case, to the names of variables. Names precede labels."""
    labels = {variable.label.casefold(): name for name, variable in checked.variables.items()}
    return labels | {name.casefold(): name for name in checked.variables}


def _judge(decisions: list[Decision], variables: Mapping[str, str], checked: CheckedSpec) -> JudgedDecision:
    first = decisions[0]
    names = (first.name, *(name for decision in decisions for name in decision.other_names))
    variable = next((variables[name.casefold()] for name in names if name.casefold() in variables), "")
    return JudgedDecision(
        decision=first,
        places=tuple(decision.place for decision in decisions),
        variable=variable,
        reason=_reason(first, variable, checked),
    )


def _reason(decision: Decision, variable: str, checked: CheckedSpec) -> str:
    """Return why a decision is not covered, or an empty text."""
    if not variable:
        return "the spec has no such variable"
    skill = next((skill for skill in checked.spec.skills if skill.name.casefold() == decision.skill.casefold()), None)
    skills = checked.spec.skills if skill is None else (skill,)
    if any(variable in skill.watched_variables for skill in skills):
        return ""
    subject = "no skill" if skill is None else f"skill '{skill.name}' neither"
    return f"{subject} previews {'or' if skill is None else 'nor'} monitors '{variable}'"


def _other_uses(checked: CheckedSpec) -> set[str]:
    """Return the variables from which Algorithm 2 starts because of loops or agents."""
    return set(checked.decisions) - {name for skill in checked.spec.skills for name in skill.watched_variables}


def _needed(names: Iterable[str], checked: CheckedSpec) -> frozenset[str]:
    """Return variables with all variables that their perception, or the expressions that derive them, need."""
    needs = {name: list(condition.variables) for name, condition in checked.derived.items()}
    for name, producers in checked.producers.items():
        needs.setdefault(name, []).extend(need for producer in producers for need in checked.algorithms[producer].needs)
    return frozenset(closure(needs, sorted(names)))


def _finding(judged: JudgedDecision) -> Diagnostic:
    decision = judged.decision
    help_text = f"add it to 'preview' of skill '{decision.skill}'"
    return Diagnostic(
        rule=_NOT_COVERED,
        message=f"skill '{decision.skill}' decides on '{decision.name}': {judged.reason}",
        place=decision.place,
        path=f"skills.{decision.skill}.{decision.name}",
        help=help_text if judged.variable else f"declare it, and {help_text}",
        related=tuple(Related("the same decision", place) for place in judged.places[1:]),
    )


def coverage_object(coverage: Coverage) -> Mapping[str, object]:
    """Return the coverage of one spec for JSON."""
    return {
        "spec": coverage.spec,
        "covered": coverage.covered_count,
        "total": len(coverage.decisions),
        "covered_percent": round(coverage.covered_percent, 2),
        "decisions": [
            {
                "name": judged.decision.name,
                "skill": judged.decision.skill,
                "text": judged.decision.text,
                "role": judged.decision.role.value,
                "is_covered": judged.is_covered,
                "variable": judged.variable or None,
                "reason": judged.reason or None,
                "places": list(map(_place_object, judged.places)),
            }
            for judged in coverage.decisions
        ],
        "unused_variables": [
            {"name": variable.name, "place": _place_object(variable.place)} for variable in coverage.unused_variables
        ],
    }


def _place_object(place: Place) -> Mapping[str, object]:
    return {"file": place.span.file, "line": place.span.line, "column": place.span.column}
