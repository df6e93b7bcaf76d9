"""Go on with a replay after its first difference: what would the package have decided?

Until the first difference, a replay repeats every step of the run. Afterwards its steps are others, so the inputs of
the run are passed at their instants, after everything that is due at this instant. Values that programs, agents and
loops wrote, and changes of the graph, are those of the run. `looks` states which results looks have, and `undetermined`
for which variables the journal does not show what the replay would have known.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from codra_dsl.runtime.clock import PUNCTUALITY_TOLERANCE_S
from codra_dsl.runtime.context.decisions import ValueDecision
from codra_dsl.runtime.journal.events import Event
from codra_dsl.runtime.journal.spec_summary import SpecSummary
from codra_dsl.runtime.replay.decision_counts import DecisionComparison
from codra_dsl.runtime.replay.jobs import DivergedError, ReplayedClock, ReplayedJobs
from codra_dsl.runtime.replay.looks import Looks
from codra_dsl.runtime.replay.player import Player, is_waiting
from codra_dsl.runtime.replay.recording import Recording
from codra_dsl.runtime.replay.undetermined import NOT_RECORDED, Undetermined

MAX_STEPS_BETWEEN_INPUTS = 50_000
"""A replay ends after this many steps without an input, because a forged journal could let it run forever."""

_FOLLOWED_ELSEWHERE = frozenset({"evidence", "unstarted", "late"})
"""Inputs that are not passed: reports are used with their jobs, and the steps of a what-if replay are punctual."""


class WhatIf:
    """Passes the rest of a journal to the context manager of a replay that has differed.

    Attributes:
        skipped_inputs: the number of inputs that were not possible in the replay, by kind of input.
    """

    def __init__(
        self,
        *,
        player: Player,
        clock: ReplayedClock,
        jobs: ReplayedJobs,
        recording: Recording,
        undetermined: Undetermined,
        decisions: DecisionComparison,
        summary: SpecSummary,
    ) -> None:
        """Store the parts of the replay; nothing is passed yet."""
        self.skipped_inputs: Counter[str] = Counter()
        self._player = player
        self._clock = clock
        self._jobs = jobs
        self._recording = recording
        self._undetermined = undetermined
        self._decisions = decisions
        self._periods_s = {
            algorithm: observer.period_s for observer in summary.observers.values() for algorithm in observer.algorithms
        }
        self._waiting_numbers: set[int] = set()

    def go_on(self, progress: Callable[[float], None]) -> str:
        """Pass the remaining inputs; return why the replay ended before the journal, or an empty text."""
        try:
            self._pass_all(progress)
        except DivergedError as error:
            return str(error)
        return ""

    def _pass_all(self, progress: Callable[[float], None]) -> None:
        self._jobs.go_on(Looks(self._clock, self._undetermined, self._periods_s))
        self._recording.expect_nothing()
        self._jobs.pair_open_jobs()
        player = self._player
        self._waiting_numbers = {number for number, decision in player.decisions.items() if is_waiting(decision)}
        self._pass_pending_input()
        while (next_input := self._recording.take_input()) is not None:
            event, _ = next_input
            self._run_until(event.instant_s)
            progress(event.instant_s)
            self._pass(event)
        if self._recording.end_s is not None:
            self._run_until(self._recording.end_s)

    def _pass_pending_input(self) -> None:
        """Pass the input at which the replay differed, unless this was tried and the replay cannot follow it."""
        event, was_tried = self._player.pending_input, self._player.has_tried_input
        if event is None:
            return
        self._run_until(event.instant_s)
        if was_tried and event.what != "delivered":
            self.skipped_inputs[event.what] += 1
        else:
            self._pass(event)

    # Time

    def _run_until(self, instant_s: float) -> None:
        ended_before_s = instant_s - PUNCTUALITY_TOLERANCE_S  # an input at the end of a wait may still bring the answer
        for _ in range(MAX_STEPS_BETWEEN_INPUTS):
            deadline_s = min(map(self._deadline_s, self._waiting_numbers), default=float("inf"))
            next_event_s = self._clock.next_event_s()
            if next_event_s > instant_s and deadline_s >= ended_before_s:
                self._clock.advance(instant_s)
                return
            if next_event_s <= deadline_s:
                self._clock.step()
            else:
                self._clock.advance(deadline_s)
            self._resume_waiting_decisions(min(self._clock.now_s(), ended_before_s))
        raise DivergedError(f"it has made {MAX_STEPS_BETWEEN_INPUTS} steps since the last input of the run")

    def _deadline_s(self, number: int) -> float:
        decision = self._player.decisions[number]
        return decision.asked_s + decision.request.wait_up_to_s

    # Inputs

    def _pass(self, event: Event) -> None:
        number = event.details.get("number", 0)
        match event.what:
            case "delivered":
                self._jobs.end_recorded_look((event.name, event.details["index"]), self._clock.now_s())
            case "waited" if number in self._player.previews:
                self._pass_to_player(event, event.what)
            case "waited":
                self._end_recorded_wait(number)
            case "found" if number not in self._player.decisions:
                pass  # the replay has answered the decision, so the main execution would not have looked
            case "looked" if number not in self._player.previews:
                pass  # likewise for a preview
            case what if what in _FOLLOWED_ELSEWHERE:
                pass
            case what:
                self._pass_to_player(event, what)
        if event.what == "decide" and number in self._player.decisions:
            self._follow_decision(number)
        if event.what == "found":
            self._waiting_numbers.discard(number)

    def _pass_to_player(self, event: Event, what: str) -> None:
        try:
            self._player.pass_input(event)
        except DivergedError:
            self.skipped_inputs[what] += 1

    # Decisions

    def _follow_decision(self, number: int) -> None:
        """Follow a decision that waits, or for which the main execution looks."""
        if is_waiting(self._player.decisions[number]):
            self._waiting_numbers.add(number)
        else:
            self._miss_look_if_answered(number)

    def _resume_waiting_decisions(self, until_s: float) -> None:
        """Resume the decisions that context can answer now, and those whose waits have ended by an instant."""
        for number in sorted(self._waiting_numbers):
            decision, now_s = self._player.decisions[number], self._clock.now_s()
            if self._player.is_met(decision, now_s) or self._deadline_s(number) <= until_s:
                self._waiting_numbers.discard(number)
                self._player.resume(number)
                self._miss_look_if_answered(number)

    def _end_recorded_wait(self, number: int) -> None:
        self._resume_waiting_decisions(self._clock.now_s())
        if number in self._player.decisions and number not in self._waiting_numbers:
            self._miss_look_if_answered(number)

    def _miss_look_if_answered(self, number: int) -> None:
        """End a decision for which the main execution would have looked, if the run answered it without a look."""
        decision = self._player.decisions.get(number)
        if decision is None or not self._decisions.take_recorded_answer(decision):
            return
        self._player.conclude_without_result(number, NOT_RECORDED)
        self._undetermined.miss_look_of_main_execution(decision.request.variable)


def count_decision(decisions: DecisionComparison, undetermined: Undetermined) -> Callable[[ValueDecision], None]:
    """Return a function that counts a decision of the replay."""

    def count(decision: ValueDecision) -> None:
        variable = decision.request.variable
        is_determined, is_assumed = variable not in undetermined.variables, variable in undetermined.assumed_variables
        decisions.add_replayed(decision, is_determined=is_determined, is_assumed=is_assumed)

    return count
