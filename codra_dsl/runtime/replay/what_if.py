"""Go on with a replay after its first difference: what would the package have decided?

Until the first difference, a replay repeats every step of the run. Afterwards its steps are others, so the inputs of
the run are passed at their instants, after everything that is due at this instant. Values that programs, agents and
loops wrote, and changes of the graph, are those of the run. `jobs` states the results of looks, and `undetermined`
states the variables about which the journal has too little information.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable

from codra_dsl.runtime.clock import PUNCTUALITY_TOLERANCE_S
from codra_dsl.runtime.journal.events import Event
from codra_dsl.runtime.replay.decision_counts import DecisionComparison
from codra_dsl.runtime.replay.jobs import DivergedError
from codra_dsl.runtime.replay.player import Player
from codra_dsl.runtime.replay.undetermined import NOT_RECORDED, Undetermined
from codra_dsl.runtime.values.declarations import MAIN

MAX_STEPS_BETWEEN_INPUTS = 50_000
"""A replay ends after this many steps without an input, because a forged journal could let it run forever."""

_FOLLOWED_ELSEWHERE = frozenset({"evidence", "late"})
"""Inputs that are not passed: reports are used with their jobs, and the steps of a what-if replay are punctual."""


class WhatIf:
    """Passes the rest of a journal to the context manager of a replay that has differed.

    Attributes:
        skipped_inputs: the number of inputs that were not possible in the replay, by kind of input.
    """

    def __init__(self, player: Player, undetermined: Undetermined, decisions: DecisionComparison) -> None:
        """Store the parts of the replay; nothing is passed yet."""
        self.skipped_inputs: Counter[str] = Counter()
        self._player = player
        self._clock = player.clock
        self._undetermined = undetermined
        self._decisions = decisions

    def go_on(self, progress: Callable[[float], None]) -> str:
        """Pass the remaining inputs; return why the replay ended before the journal, or an empty text."""
        recording = self._player.recording
        recording.expect_nothing()
        self._player.jobs.go_on(self._clock)
        try:
            self._pass_pending_input()
            while (next_input := recording.take_input()) is not None:
                event, _ = next_input
                self._run_until(event.instant_s)
                progress(event.instant_s)
                self._pass(event)
            if recording.end_s is not None:
                self._run_until(recording.end_s)
        except DivergedError as error:
            return str(error)
        return ""

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
            check_s = min(map(self._player.next_check_s, self._player.waiting_numbers()), default=math.inf)
            next_event_s = self._clock.next_event_s()
            may_still_wait = check_s >= ended_before_s
            if may_still_wait and next_event_s > instant_s:
                self._clock.advance(instant_s)
                return
            if may_still_wait or next_event_s <= check_s:
                self._clock.step()
            else:
                self._clock.advance(check_s)
            self._resume_waiting_decisions(min(self._clock.now_s(), ended_before_s))
        raise DivergedError(f"it has made {MAX_STEPS_BETWEEN_INPUTS} steps since the last input of the run")

    # Inputs

    def _pass(self, event: Event) -> None:
        number = event.details.get("number", 0)
        match event.what:
            case "waited":
                self._resume_waiting_decisions(self._clock.now_s())
            case "delivered" | "unstarted":
                self._player.jobs.deliver((event.name, event.details["index"]), self._clock.now_s())
            case "found" | "looked":
                self._pass_look(event, number)
            case what if what not in _FOLLOWED_ELSEWHERE:
                self._doubt_overtaken_decisions(event)
                self._pass_to_player(event)
        if event.what in ("decide", "preview", "waited", "looked"):
            self._miss_looks_if_ended(number)

    def _pass_look(self, event: Event, number: int) -> None:
        """Pass a look of the main execution, if it would look in the replay, too: only for what is missing."""
        decision = self._player.decisions.get(number)
        variable = event.details.get("variable")
        if decision is not None and (variable is None or variable in decision.missing):
            with self._undetermined.look_of_main_execution(variable or decision.name, decision.variables):
                self._pass_to_player(event)

    def _pass_to_player(self, event: Event) -> None:
        try:
            self._player.pass_input(event)
        except DivergedError:
            self.skipped_inputs[event.what] += 1

    # Decisions

    def _doubt_overtaken_decisions(self, event: Event) -> None:
        """Doubt the decisions that wait only in the replay, if the main execution changes something.

        It would not change this before the end of the wait.
        """
        if event.name == MAIN and event.what in ("act", "write"):
            for number in self._player.waiting_numbers():
                if self._player.decisions[number].until_s > event.instant_s:
                    self._decisions.doubt_if_ended(self._player.decisions[number])

    def _resume_waiting_decisions(self, until_s: float) -> None:
        """Resume the decisions that context can answer now, and those whose waits have ended by an instant."""
        for number in self._player.waiting_numbers():
            if self._player.is_wait_over(number, until_s):
                self._player.resume(number)
                self._miss_looks_if_ended(number)

    def _miss_looks_if_ended(self, number: int) -> None:
        """End a decision for which the main execution would look, if the run ended it without this look."""
        decision = self._player.decisions.get(number)
        if decision is None or decision.is_waiting or not self._decisions.take_recorded_end(decision):
            return
        for variable in decision.missing:
            self._undetermined.miss_look_of_main_execution(variable)
        self._player.abandon(number, NOT_RECORDED)
