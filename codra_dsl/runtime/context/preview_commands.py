"""The commands of previews: each is a step, recorded before its execution, as the commands in `commands` are."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from codra_dsl.logic import Value
from codra_dsl.runtime.context.previews import Preview, PreviewContext, PreviewRequest
from codra_dsl.runtime.journal import EventWriter, Kind
from codra_dsl.runtime.journal.encoding import json_text
from codra_dsl.runtime.locked_clock import LockedClock
from codra_dsl.runtime.observers.store import Store
from codra_dsl.runtime.observers.urgency import Urgencies
from codra_dsl.runtime.values.cell import Reading
from codra_dsl.runtime.values.declarations import MAIN
from codra_dsl.runtime.values.model import SkillModel
from codra_dsl.runtime.values.previews import PreviewOutcome, evaluate, with_details


class PreviewCommands:
    """The commands of previews. No command waits."""

    def __init__(
        self,
        *,
        clock: LockedClock,
        event_writer: EventWriter,
        store: Store,
        urgencies: Urgencies,
        skills: Mapping[str, SkillModel],
        explain: Callable[[Reading[Value]], Reading[Value]],
        next_number: Callable[[], int],
        keep_value: Callable[[str, Value, float], bool],
    ) -> None:
        """Execute the commands on the parts of a context manager.

        Args:
            clock: makes each command a step.
            event_writer: records each command and each answer.
            store: holds the variables.
            urgencies: notes the variables for which a preview waits.
            skills: the skills by name.
            explain: adds to an unknown reading the reason why the variable cannot be observed now.
            next_number: returns the number of the next decision in the run.
            keep_value: keeps a value that the main execution found by a look, if it may write the variable; the last
                argument is the start of the look.
        """
        self._clock = clock
        self._event_writer = event_writer
        self._store = store
        self._urgencies = urgencies
        self._skills = skills
        self._explain = explain
        self._next_number = next_number
        self._keep_value = keep_value

    def ask(self, request: PreviewRequest) -> Preview:
        """Return a new preview. If context decides it, or nobody can wait or look for it, it is answered at once."""
        with self._clock:
            number, skill = self._next_number(), self._skills[request.skill]
            self._event_writer.write_input(MAIN, "preview", number=number, **_request_fields(request))
            answer = evaluate(skill, self._context(skill, request, {}))
            preview = Preview(number=number, request=request, skill=skill, asked_s=self._clock.now_s(), answer=answer)
            if answer.outcome is PreviewOutcome.UNKNOWN and request.wait_up_to_s > 0:
                self._urgencies.wait(number, *(variable.name for variable in answer.unknown))
                return preview
            self._answer_or_look(preview)
            return preview

    def resume(self, preview: Preview) -> None:
        """Evaluate a preview again after the wait; answer it, or let the main execution look."""
        with self._clock:
            self._event_writer.write_input(MAIN, "waited", number=preview.number)
            self._urgencies.answer(preview.number)
            self._answer_or_look(preview)

    def record_look(self, preview: Preview, variable: str, content: Value | None) -> None:
        """Record what the main execution found for a variable, and answer the preview if it is decided now.

        The value is kept under the conditions under which a decision on the variable would keep it.
        """
        with self._clock:
            self._event_writer.write_input(MAIN, "looked", number=preview.number, variable=variable, value=content)
            preview.looked[variable] = content
            if content is not None:
                self._keep_value(variable, content, preview.looked_s)
            self._answer_or_look(preview)

    def abandon(self, preview: Preview, raised: str) -> None:
        """Record that the main execution stopped waiting or looking: the name of the error, or why."""
        with self._clock:
            self._event_writer.write_input(MAIN, "looked", number=preview.number, raised=raised)
            self._urgencies.answer(preview.number)
            self._evaluate(preview)
            self._record_answer(preview, raised=raised)

    def is_decided(self, preview: Preview) -> bool:
        """Return whether context decides a preview now; takes no step."""
        answer = evaluate(preview.skill, self._context(preview.skill, preview.request, preview.looked))
        return answer.outcome is not PreviewOutcome.UNKNOWN

    def flips_s(self, preview: Preview) -> float:
        """Return in how many seconds an age in a condition next passes its limit; infinite if none does."""
        context = self._context(preview.skill, preview.request, preview.looked)
        waits_s = (condition.condition.flips_s(context) for condition in preview.skill.preview_conditions)
        return min((wait_s for wait_s in waits_s if wait_s is not None), default=math.inf)

    def _answer_or_look(self, preview: Preview) -> None:
        """Answer a preview, or note that the main execution begins to look for the next variable."""
        self._evaluate(preview)
        if preview.missing:
            preview.looked_s = self._clock.now_s()
        else:
            self._record_answer(preview)

    def _evaluate(self, preview: Preview) -> None:
        skill = preview.skill
        context = self._context(skill, preview.request, preview.looked)
        answer = evaluate(skill, context)
        readings = context.readings
        details = {variable.name: self._explain(readings[variable.name]).detail for variable in answer.unknown}
        preview.answer = with_details(answer, details)
        preview.sources = {
            name: readings[name].source
            if preview.request.permits(readings[name], context.now_s)
            else (MAIN if context.value(name) is not None else "")
            for name in skill.preview
        }

    def _context(
        self, skill: SkillModel, request: PreviewRequest, looked: Mapping[str, Value | None]
    ) -> PreviewContext:
        readings = {name: self._store.reading(name) for name in skill.preview}
        return PreviewContext(request, readings, looked, self._clock.now_s())

    def _record_answer(self, preview: Preview, **details: object) -> None:
        preview.is_over = True
        answer, is_unknown = preview.answer, preview.answer.outcome is PreviewOutcome.UNKNOWN
        what = "fell_back" if preview.looked else "unanswered" if is_unknown else "answered"
        lists = {
            "violated": answer.violated,
            "undecided": answer.undecided,
            "unknown": [variable.name for variable in answer.unknown],
            "reasons": [variable.reason for variable in answer.unknown],
            "details": [variable.detail for variable in answer.unknown],
            "looked": preview.looked,
        }
        self._event_writer.write(
            Kind.PREVIEW,
            preview.skill.name,
            what,
            outcome=str(answer.outcome),
            **{key: list(entries) for key, entries in lists.items() if entries},
            variables=list(preview.sources),
            sources=list(preview.sources.values()),
            asked_s=preview.asked_s,
            **details,
        )


def _request_fields(request: PreviewRequest) -> dict[str, object]:
    """Return the fields of a request that differ from the defaults, and the skill."""
    fields: dict[str, object] = {"skill": request.skill}
    if request.max_age_s < math.inf:
        fields["max_age_s"] = request.max_age_s
    if request.since_s:
        fields["since"] = json_text(dict(request.since_s))
    if request.wait_up_to_s > 0:
        fields["wait_up_to_s"] = request.wait_up_to_s
    if request.looks:
        fields["looks"] = True
    return fields
