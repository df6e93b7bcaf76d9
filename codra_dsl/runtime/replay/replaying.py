"""Derive the events of a run again from its journal, and compare them with the recorded events."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace

from codra_dsl.runtime.clock import PUNCTUALITY_TOLERANCE_S
from codra_dsl.runtime.context.context import ContextManager
from codra_dsl.runtime.context.model import ContextModel
from codra_dsl.runtime.journal.event_log import EventLog
from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.journal.run_header import RunHeader
from codra_dsl.runtime.journal.spec_summary_changes import changes_by_distance, find_changes
from codra_dsl.runtime.knowledge import KnowledgeModel, Snapshot
from codra_dsl.runtime.replay.comparison import Comparison, Difference, Replayed
from codra_dsl.runtime.replay.decision_counts import DecisionComparison
from codra_dsl.runtime.replay.jobs import DivergedError
from codra_dsl.runtime.replay.player import Build, Player
from codra_dsl.runtime.replay.recording import Recording
from codra_dsl.runtime.replay.undetermined import Undetermined
from codra_dsl.runtime.replay.what_if import MAX_STEPS_BETWEEN_INPUTS, WhatIf

_ROUNDING_S = 1e-9
"""Instants of simulated time that differ by less are the same."""

_WITHIN_INSTANT = frozenset({"delivered", "evidence", "late", "unstarted", "waited"})
"""Inputs that may come, in simulated time, before other steps of their instant."""


def _show_nothing(_: float) -> None:
    """Show no progress."""


def replay(  # noqa: PLR0917 - the parts of a journal and of a package
    header: RunHeader,
    events: Sequence[Event] | Recording,
    model: ContextModel,
    build: Build,
    copy: EventLog | None,
    knowledge: KnowledgeModel | None = None,
    progress: Callable[[float], None] = _show_nothing,
    from_s: float = -math.inf,
) -> Replayed:
    """Derive the events of a run again, and compare them with those of its journal.

    After the first difference, the replay goes on to the end of the journal: it counts how decisions would have been
    answered.

    Args:
        header: the run header of the journal.
        events: the events of the journal, or a recording, which does not hold all events in memory.
        model: the model of the compiled spec.
        build: creates the context manager of the package.
        copy: an event log that receives the derived events, e.g. a `Journal`. If there is no difference, the file of
            this journal equals, byte for byte, the file of the replayed journal.
        knowledge: the knowledge graph of the spec, if it has one.
        progress: this function is called for each input, with the time since the start of the run.
        from_s: earlier events and decisions are not counted. A difference is reported, whenever it is.

    Raises:
        JournalError: if the file of the journal exceeds a limit.
    """

    def show_instant(instant_s: float) -> None:
        progress(instant_s - header.start_s)

    recording = events if isinstance(events, Recording) else Recording.of(events)
    comparison, decisions = Comparison(recording, copy, from_s), DecisionComparison(from_s)
    recording.on_decision = decisions.add_recorded
    player = Player(header, recording, model, build, comparison, knowledge)
    undetermined = Undetermined((comparison.header or header).summary)
    player.on_decision = lambda decision: decisions.add_replayed(decision, undetermined)
    player.jobs.undetermined = undetermined
    comparison.on_event = undetermined.add_event
    comparison.check_completeness(_follow(player, comparison, header, show_instant) or "")
    ended_because, skipped_inputs = "", Counter[str]()
    if comparison.difference is not None:
        what_if = WhatIf(player, undetermined, decisions)
        ended_because, skipped_inputs = what_if.go_on(show_instant), what_if.skipped_inputs
    recording.check()
    comparison.end()
    return Replayed(
        compared=comparison.compared,
        derived=comparison.derived,
        absent=comparison.absent(),
        difference=_with_changes(comparison, header),
        decisions=decisions.counts(Kind.DECISION),
        previews=decisions.counts(Kind.PREVIEW),
        missing_looks=dict(sorted(undetermined.missing_looks.items())),
        skipped_inputs=dict(sorted(skipped_inputs.items())),
        ended_because=ended_because,
    )


def knowledge_at(
    header: RunHeader, events: Sequence[Event], model: ContextModel, knowledge: KnowledgeModel, instant_s: float
) -> Snapshot:
    """Return the knowledge graph at an instant of a run, derived again from the run's journal.

    Args:
        header: the run header of the journal.
        events: the events of the journal.
        model: the model of the compiled spec.
        knowledge: the knowledge graph of the spec.
        instant_s: the instant.

    Raises:
        ValueError: if the run had not begun at that instant, or the journal's events do not follow from its inputs.
    """
    if instant_s < header.start_s:
        raise ValueError(f"the run begins at {header.start_s}, after {instant_s}: ask for a later instant")
    recording = Recording.of([event for event in events if event.instant_s <= instant_s])
    comparison = Comparison(recording, None)
    player = Player(header, recording, model, ContextManager, comparison, knowledge)
    divergence_text = _follow(player, comparison, header, _show_nothing)
    if comparison.difference is not None or divergence_text is not None:
        raise ValueError(f"the journal does not follow from its inputs: {divergence_text or comparison.difference}")
    player.clock.advance(instant_s)
    return player.manager.knowledge.at(instant_s)


def _follow(player: Player, comparison: Comparison, header: RunHeader, progress: Callable[[float], None]) -> str | None:
    """Follow a journal until the first difference; return why the replay stopped before its end, if it did."""
    clock, recording = player.clock, player.recording
    try:
        _pass_inputs(player, comparison, progress, is_same=_is_same_package(header, comparison.header))
        end_s = clock.now_s() if recording.end_s is None else recording.end_s
        while not comparison.is_over and clock.next_event_s() <= end_s:
            clock.step()  # the journal may end in the middle of the run, after its last input
    except DivergedError as error:
        return str(error)
    finally:
        recording.check()
    return None


def _with_changes(comparison: Comparison, header: RunHeader) -> Difference | None:
    """Return the first difference, with the changes of the spec."""
    difference = comparison.difference
    if difference is None or comparison.header is None:
        return difference
    names = [event.name for event in (difference.replayed, difference.recorded) if event is not None]
    return replace(difference, changes=changes_by_distance(names, header.summary, comparison.header.summary))


def _is_same_package(header: RunHeader, replayed_header: RunHeader | None) -> bool:
    """Return whether the package that is replayed has the model of the run, as far as digests and summaries show."""
    if replayed_header is None:
        return True
    digests = {header.model, replayed_header.model} - {""}  # a model that was built by hand has no digest
    return len(digests) < 2 and not any(find_changes(header.summary, replayed_header.summary))


def _pass_inputs(player: Player, comparison: Comparison, progress: Callable[[float], None], *, is_same: bool) -> None:
    """Pass the inputs of a journal until the first difference."""
    clock, recording, passed_step = player.clock, player.recording, 0
    while (next_input := recording.take_input()) is not None:
        event, is_last = next_input
        player.pending_input, player.has_tried_input = event, False
        passed_s, step = clock.now_s(), event.details["step"]
        last_step, passed_step = clock.step_count + step - passed_step, step
        while comparison.difference is None and _is_step_before(event, player, last_step, passed_s, is_same=is_same):
            if clock.step_count >= max(last_step, 0) + MAX_STEPS_BETWEEN_INPUTS:
                raise DivergedError(f"it has made {MAX_STEPS_BETWEEN_INPUTS} steps more than the run before an input")
            clock.step()
        if comparison.difference is not None:
            return
        clock.advance(event.instant_s)
        progress(event.instant_s)
        comparison.may_continue |= is_last  # a journal may break off within the events of its last input
        player.has_tried_input = True
        player.pass_input(event)
        player.pending_input = None


def _is_step_before(event: Event, player: Player, last_step: int, passed_s: float, *, is_same: bool) -> bool:
    """Return whether the next step comes before an input.

    Between two inputs, a replay makes as many steps as the run. If the package differs from that of the run, it may
    make more or fewer steps without an event, such as the end of a validity that was renewed. Then the events before
    the input show which steps come first, and other steps come at their times.

    Args:
        event: the input.
        player: makes the steps.
        last_step: the number of steps that the replay has made before the input, if it makes as many as the run.
        passed_s: the instant of the previous input.
        is_same: whether the package is that of the run.
    """
    clock, due_s, instant_s = player.clock, player.clock.next_event_s(), event.instant_s
    if is_same and due_s <= instant_s and clock.step_count < last_step:
        return True  # in most cases, without decoding the events before the input
    if player.recording.expects_event_before_input():
        if due_s > instant_s:
            raise DivergedError
        return is_same or not _ends_job_before_next_step(event, player)
    if due_s > instant_s or clock.step_count < last_step:
        return due_s <= instant_s and (is_same or not _ends_job_before_next_step(event, player))
    if due_s < instant_s - PUNCTUALITY_TOLERANCE_S:
        return event.what != "late" and not player.recording.is_late(event.details["step"], due_s)
    # Seconds since 1970, as in real time, are too coarse: a step and an input with the same number differ by chance.
    is_at_same_instant = math.ulp(instant_s) < _ROUNDING_S and instant_s > passed_s and due_s >= instant_s - _ROUNDING_S
    may_be_before = not is_same and event.what not in _WITHIN_INSTANT
    return is_at_same_instant and may_be_before and clock.is_next_event_before(instant_s)


def _ends_job_before_next_step(event: Event, player: Player) -> bool:
    """Return whether an input ends an earlier job, and the next step was scheduled at the instant of the input.

    In simulated time, the end of a job that began earlier was scheduled before this step, so it comes first.
    """
    if event.what != "delivered" or player.clock.is_next_event_before(event.instant_s):
        return False
    return player.jobs.began_before((event.name, int(event.details["index"])), event.instant_s)
