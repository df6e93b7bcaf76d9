"""The day with alternatives by rank (P1, section 1: complementary observers), compared with the day without them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

from codra_dsl.language.model import Spec
from codra_papers.experiments.campaign.document import Section, Table, Words
from codra_papers.experiments.lab.algorithms import alternatives
from codra_papers.experiments.lab.arms import ALTERNATIVES
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.studies.beyond.complementary import (
    VARIABLE,
    knowledge,
    knowledge_as_data,
    knowledge_sentence,
    knowledge_table,
    out_of_view,
)
from codra_papers.experiments.studies.lab_runtime.finding import Finding
from codra_papers.experiments.studies.lab_runtime.runs import WITH_ALTERNATIVES, WITH_OBSERVERS


@dataclass(frozen=True, slots=True, kw_only=True)
class Answers:
    """The answers to the decisions of a day on one variable.

    Attributes:
        answered: how many decisions context answered.
        by_alternatives: how many of these answers rest on the evidence of an alternative.
        untrue: how many answers, of context or of a look, were not true.
    """

    decisions: int
    answered: int
    by_alternatives: int
    untrue: int


def answers(outcome: Outcome, variable: str, alternative_names: Sequence[str]) -> Answers:
    """Return how the decisions on a variable were answered."""
    decisions = [decision for decision in outcome.decisions if decision.variable == variable]
    return Answers(
        decisions=len(decisions),
        answered=sum(not decision.has_looked for decision in decisions),
        by_alternatives=sum(decision.source in alternative_names for decision in decisions),
        untrue=sum(decision.wrong_answer is not None for decision in decisions),
    )


def judge_alternatives(spec: Spec, observed: Outcome, with_alternatives: Outcome) -> Finding:
    """Report what alternatives add.

    Args:
        spec: the spec under test.
        observed: the day without alternatives.
        with_alternatives: the day with alternatives.
    """
    names_by_variable = alternatives(spec)
    same_frames = knowledge(
        [observed],
        {"Lid out of view": out_of_view, "The whole day": lambda outcome: outcome.truth[VARIABLE]},
        names_by_variable.get(VARIABLE, ()),
    )
    days = {WITH_OBSERVERS: observed, WITH_ALTERNATIVES: with_alternatives}
    answers_by_variable = {
        variable: {day: answers(outcome, variable, names) for day, outcome in days.items()}
        for variable, names in names_by_variable.items()
    }
    triggers = with_alternatives.arms[ALTERNATIVES.name].triggers
    looks = {name: triggers.get(name, 0) for names in names_by_variable.values() for name in names}
    return Finding(
        section=Section(
            title="Alternatives by rank",
            parts=[
                Words(
                    text="All other runs with observers have one algorithm for each variable. This day is run again"
                    " with the same seed and with the alternatives of the spec. An alternative looks if the"
                    " algorithms of lower rank cannot, or if their results are rejected."
                ),
                _answers_table(answers_by_variable),
                Words(
                    text="On the day without alternatives, an arm with alternatives watched the same frames and"
                    " answered nothing. The lid is out of view while the robot is near the centrifuge and less than"
                    " half of the corners of the lid's tags are in the image."
                ),
                knowledge_table(same_frames, "The day with observers: all arms on the same frames."),
                Table(
                    caption="How often each alternative looked on the day with alternatives.",
                    header=("algorithm", "looks"),
                    rows=list(looks.items()),
                ),
            ],
        ),
        summary=[_sentence(variable, entries) for variable, entries in answers_by_variable.items()]
        + [knowledge_sentence(same_frames, "Lid out of view")],
        results={
            "alternatives": {
                "answers": {
                    variable: {day: asdict(entry) for day, entry in entries.items()}
                    for variable, entries in answers_by_variable.items()
                },
                "looks": looks,
                "same_frames": knowledge_as_data(same_frames),
                "loops": {day: outcome.loops for day, outcome in days.items()},
            }
        },
    )


def _answers_table(answers_by_variable: Mapping[str, Mapping[str, Answers]]) -> Table:
    return Table(
        caption="Decisions of the day on the variables that have alternatives.",
        header=("variable", "day", "decisions", "answered by context", "of these by an alternative", "not true"),
        rows=[
            (variable, day, entry.decisions, entry.answered, entry.by_alternatives, entry.untrue)
            for variable, entries in answers_by_variable.items()
            for day, entry in entries.items()
        ],
    )


def _sentence(variable: str, entries: Mapping[str, Answers]) -> str:
    without, observed = entries[WITH_OBSERVERS], entries[WITH_ALTERNATIVES]
    return (
        f"On the day, context answered {without.answered} of {without.decisions} decisions on {variable} without"
        f" alternatives, and {observed.answered} of {observed.decisions} with alternatives;"
        f" {observed.by_alternatives} of these answers rest on the evidence of an alternative."
    )
