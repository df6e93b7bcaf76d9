"""The session of a main execution that uses messages: its declarations, decisions, subscriptions and lease.

A session calls the context manager as a program would, step by step and without waiting: a decision that may wait is
answered later. The declarations of a session are withdrawn when the main execution leaves, or sends no message within
the lease.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterable, Sized
from dataclasses import dataclass
from typing import Any

from codra_dsl.runtime.callbacks import Subscription
from codra_dsl.runtime.clock import Clock, Timer
from codra_dsl.runtime.context.agents import Agent
from codra_dsl.runtime.context.context import ContextManager
from codra_dsl.runtime.context.package_files import manifest_of, package_folder
from codra_dsl.runtime.context.pending_decision import DecisionState, PendingDecision, PendingPreview
from codra_dsl.runtime.errors import unknown_name_error
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.perception import Failure, Interval
from codra_dsl.runtime.remote.agents.agent_session import AgentSession
from codra_dsl.runtime.remote.host_orders import HostOrders
from codra_dsl.runtime.remote.permissions import Permissions
from codra_dsl.runtime.remote.protocol import (
    AGENT_REQUESTS,
    REPORTED_ERRORS,
    LeaseError,
    MessageError,
    NotPermittedError,
    PlainData,
    Request,
    answer_to,
    error_to,
    id_of,
    notice,
    plain_preview,
    plain_reading,
    plain_type,
    request_of,
)
from codra_dsl.runtime.values.cell import Reading, Reason
from codra_dsl.runtime.values.declarations import MAIN
from codra_dsl.runtime.values.model import VariableModel

MAX_LOOKING_DECISIONS = 1_000
"""The maximum number of decisions for which the main execution looks itself.

If there are more, the oldest decision is abandoned.
"""

MAX_WAITING_DECISIONS = 1_000
"""The maximum number of decisions of a session that wait for context."""

MAX_RUNNING_SKILLS = 100
"""The maximum number of skills of a session that run at the same time."""

MAX_EXPLANATION_CHARACTERS = 100_000
"""The maximum length of an explanation; the rest is cut off."""

MAX_SUBSCRIPTIONS = 100
"""The maximum number of subscriptions of a session; one subscription may have many variables."""

_LOGGER = logging.getLogger(__name__)

LEASE_S = 5.0
"""How long a session lasts without a message, unless its main execution requests another time."""

Send = Callable[[PlainData], None]


def open_session(codra: ContextManager[Any, Any], send: Send, permissions: Permissions | None = None) -> Session:
    """Begin a session for a further main execution, which may run anywhere and sends messages of plain data.

    Args:
        codra: the context manager.
        send: receives answers and notices, in any thread; it must neither wait nor raise an exception.
        permissions: the requests that the user of the session may make; by default all requests.
    """
    return Session(codra, codra.clock, codra.next_main_execution_name(), send, permissions)


class Session:
    """The manager's side of one main execution."""

    def __init__(
        self,
        codra: ContextManager[Any, Any],
        clock: Clock,
        party: str,
        send: Send,
        permissions: Permissions | None = None,
    ) -> None:
        """Begin a session; use `open_session`.

        Args:
            codra: the context manager.
            clock: the clock of the context manager, which ends the lease and the waits.
            party: the name of the session in declarations.
            send: receives answers and notices; it must neither wait nor raise an exception.
            permissions: the requests that the user of the session may make; by default all requests.
        """
        self.party = party
        self._codra = codra
        self._commands = codra.commands
        self._variables = {variable.name: variable for variable in codra.model.variables}
        self._skills = frozenset(skill.name for skill in codra.model.skills)
        self._clock = clock
        self._send = send
        self._permissions = permissions
        self._lock = new_lock()
        self._lease_s = LEASE_S
        self._last_message_s = clock.now_s()
        self._end_reason = ""
        self._running_skills: set[int] = set()
        self._looking_decisions: dict[int, PendingDecision | PendingPreview] = {}
        self._waiting_decisions: dict[int, _WaitingDecision] = {}
        self._subscriptions: dict[int, dict[str, object]] = {}
        self._readings = Subscription(lambda: None)
        self._subscription_count = 0
        self._agents: dict[str, Agent[Any, Any]] = {}
        self._agent_session = AgentSession(codra, send, self._agents, self._agent, self._check_digest)
        self._host = ""
        self._lease = Timer(math.inf, lambda: None)
        self._check_lease()

    @property
    def is_over(self) -> bool:
        """Return whether the session has ended."""
        return bool(self._end_reason)

    def receive(self, message: object) -> None:
        """Handle one message. The answer is passed to `send` immediately, or later if a decision has to wait."""
        with self._lock:
            try:
                request = request_of(message)
                self._check_alive()
                if self._permissions is not None:
                    self._permissions.check(request)
                self._last_message_s = self._clock.now_s()
                answer = self._handle_request(request)
            except NotPermittedError as error:
                _LOGGER.warning("refused: %s", error)
                self._send(error_to(id_of(message), error))
                return
            except REPORTED_ERRORS as error:
                self._send(error_to(id_of(message), error))
                return
            if answer is not None:
                self._send(answer_to(request.id, answer))

    def close(self, because: str = "the session was closed") -> None:
        """Withdraw all declarations and end the session; do nothing if it is over."""
        with self._lock:
            if self._end_reason:
                return
            self._end_reason = because
            self._commands.leave(self.party)
            self._lease.cancel()
            self._readings.unsubscribe()
            for waiting_decision in self._waiting_decisions.values():
                waiting_decision.end()
            for decision in (
                *(waiting_decision.decision for waiting_decision in self._waiting_decisions.values()),
                *self._looking_decisions.values(),
            ):
                decision.abandon(LeaseError.__name__)
            self._agent_session.close()
            for agent in self._agents.values():
                agent.close()
            if self._host:
                self._codra.hosts.disconnect(self._host, because)
            for container in (self._subscriptions, self._waiting_decisions, self._looking_decisions, self._agents):
                container.clear()

    # Requests: the handler of request `NAME` is `_NAME`

    def _handle_request(self, request: Request) -> PlainData | None:
        if request.ask == "decide":
            return self._decide(request.id, **request.fields)
        if request.ask == "preview":
            return self._preview(request.id, **request.fields)
        if request.ask in AGENT_REQUESTS:
            return self._agent_session.handle(request)
        handler: Callable[..., PlainData] = getattr(self, f"_{request.ask}")
        return handler(**request.fields)

    def _hello(self, lease_s: float = LEASE_S, token: str = "") -> PlainData:
        del token  # the server has checked it, if it needs one
        self._lease_s = lease_s
        self._check_lease()
        return {
            "spec": self._codra.model.name,
            "party": self.party,
            "lease_s": lease_s,
            "now_s": self._clock.now_s(),
            "variables": list(self._variables),
            "skills": sorted(self._skills),
        }

    def _keep(self) -> PlainData:
        return {"now_s": self._clock.now_s()}

    def _declare(self, variable: str, value: object = None) -> PlainData:
        content = None if value is None else self._variable(variable).type.convert(value)
        self._commands.declare(self._variable(variable).name, caller=self.party)
        if content is not None:
            self._commands.write(variable, content, MAIN, None)
        return {}

    def _withdraw(self, variable: str) -> PlainData:
        self._commands.withdraw(self._variable(variable).name, caller=self.party)
        return {}

    def _expect(self, skills: list[str]) -> PlainData:
        self._commands.expect([self._skill(name) for name in dict.fromkeys(skills)], caller=self.party)
        return {}

    def _begin(self, skill: str) -> PlainData:
        _check_number("skills in progress", self._running_skills, MAX_RUNNING_SKILLS)
        number = self._commands.begin(self._skill(skill), caller=self.party)
        self._running_skills.add(number)
        return {"number": number}

    def _act(self, number: int) -> PlainData:
        self._check_begun(number)
        self._commands.act(number)
        return {}

    def _acted(self, number: int) -> PlainData:
        self._check_begun(number)
        self._commands.acted(number)
        return {}

    def _finish(self, number: int) -> PlainData:
        self._check_begun(number)
        self._running_skills.discard(number)
        self._commands.finish(number)
        return {}

    def _describe(self, variable: str) -> PlainData:
        return {"type": plain_type(self._variable(variable).type)}

    def _get(self, variable: str) -> PlainData:
        return {"reading": plain_reading(self._codra.get(variable))}

    def _why(self, name: str) -> PlainData:
        return {"text": str(self._codra.why(name))[:MAX_EXPLANATION_CHARACTERS]}

    def _obstacle(self, variable: str) -> PlainData:
        return {"obstacle": self._codra.obstacle(variable)}

    def _set(
        self, variable: str, value: object, evidence_s: float | None = None, agent: str | None = None
    ) -> PlainData:
        writer = self._codra if agent is None else self._agent(agent)
        writer.set(variable, value, evidence_s=evidence_s)
        return {}

    def _override(self, variable: str, for_s: float, reason: str, value: object = None) -> PlainData:
        self._codra.override(variable, value, for_s=for_s, reason=reason)
        return {}

    def _clear_override(self, variable: str) -> PlainData:
        self._codra.clear_override(variable)
        return {}

    def _subscribe(self, variables: list[str]) -> PlainData:
        _check_number("subscriptions", self._subscriptions, MAX_SUBSCRIPTIONS)
        last_states: dict[str, object] = {self._variable(name).name: None for name in variables}
        self._subscription_count += 1
        self._subscriptions[self._subscription_count] = last_states
        self._subscribe_once(self._subscription_count)
        return {"subscription": self._subscription_count}

    def _subscribe_once(self, generation: int) -> None:
        """Replace the subscription to the variables of all subscriptions of the session.

        There is only one, because each subscription may start a thread when a variable changes.
        """
        names = dict.fromkeys(name for last_states in self._subscriptions.values() for name in last_states)
        self._readings.unsubscribe()
        self._readings = self._codra.subscribe(names, lambda reading: self._send_reading(generation, reading))

    def _send_reading(self, generation: int, reading: Reading[Any]) -> None:
        """Send a reading to the subscriptions that do not have it, unless `_readings` was replaced in the meantime."""
        state = (reading.content, reading.reason)
        with self._lock:  # send after the answer with the number, and never after the answer to `unsubscribe`
            if generation != self._subscription_count:
                return
            for number, last_states in tuple(self._subscriptions.items()):  # sending may end the session
                if reading.name in last_states and last_states[reading.name] != state:
                    last_states[reading.name] = state
                    self._send(notice("reading", subscription=number, reading=plain_reading(reading)))

    def _unsubscribe(self, subscription: int) -> PlainData:
        if self._subscriptions.pop(subscription, None) is None:
            raise MessageError(f"there is no subscription {subscription}")
        if not self._subscriptions:
            self._readings.unsubscribe()
        return {}

    def _leave(self) -> PlainData:
        self.close("the main execution has left")
        return {}

    # Hosts

    def _attach(self, host: str, digest: str = "") -> PlainData:
        try:
            self._check_digest(f"host {host!r}", digest)
        except ValueError:
            self._codra.hosts.refuse(host, "it has another version of the spec than the manager")
            raise
        if self._host:
            raise ValueError(f"this session is host {self._host!r} already")
        self._codra.hosts.connect(host, HostOrders(self._send))
        self._host = host
        return {}

    def _check_digest(self, program: str, digest: str) -> None:
        if digest != manifest_of(package_folder(self._codra)).get("model", ""):
            raise ValueError(
                f"{program} has another version of the spec than the manager: "
                "compile both from the same files, with the same --site"
            )

    def _evidence(
        self, *, algorithm: str, index: int, start_s: float, stamp_s: float, earliest_s: float, host_s: list[float]
    ) -> PlainData:
        if not -math.inf < start_s <= earliest_s <= stamp_s:
            raise ValueError(f"evidence has a start, then a stamp: not {start_s} and {earliest_s} to {stamp_s}")
        now_s = self._clock.now_s()  # what has reached the manager cannot have ended later
        interval = Interval(start_s, min(stamp_s, now_s), min(earliest_s, now_s), (host_s[0], host_s[1]))
        self._codra.hosts.report_evidence(self._host, (algorithm, index), interval)
        return {}

    def _ended(self, algorithm: str, index: int, values: list[PlainData] | None = None, message: str = "") -> PlainData:
        outcome = (
            Failure(Reason.FAILED, message)
            if values is None
            else {named_value["name"]: named_value["value"] for named_value in values}
        )
        self._codra.hosts.end(self._host, (algorithm, index), outcome)
        return {}

    # Decisions

    def _decide(self, request_id: int | str | None, variable: str, **options: Any) -> PlainData | None:
        _check_number("decisions that wait", self._waiting_decisions, MAX_WAITING_DECISIONS)
        decision = self._codra.ask(variable, **options)
        return self._answer_or_wait(request_id, decision, [variable])

    def _preview(self, request_id: int | str | None, skill: str, **options: Any) -> PlainData | None:
        _check_number("decisions that wait", self._waiting_decisions, MAX_WAITING_DECISIONS)
        preview = self._codra.ask_preview(self._skill(skill), **options)
        variables = self._codra.skills()[skill].preview
        return self._answer_or_wait(request_id, preview, variables)

    def _answer_or_wait(
        self,
        request_id: int | str | None,
        decision: PendingDecision | PendingPreview,
        variables: Iterable[str],
    ) -> PlainData | None:
        """Return the answer to a decision; None if the decision waits, so that it is answered later."""
        if decision.state is not DecisionState.WAITING:
            return self._decision_answer(decision)
        self._waiting_decisions[decision.number] = _WaitingDecision(
            decision=decision,
            request_id=request_id,
            timer=self._clock.call_at(decision.next_check_s(), lambda: self._resume(decision)),
            subscriptions=tuple(self._codra.follow(variable, lambda: self._resume(decision)) for variable in variables),
        )
        self._resume(decision)  # for events that happened before `follow` could call back
        return None

    def _resume(self, decision: PendingDecision | PendingPreview) -> None:
        """Answer a decision that has waited, if it can be answered or has waited long enough."""
        with self._lock:
            waiting_decision = self._waiting_decisions.get(decision.number)
            if waiting_decision is None:
                return
            if decision.poll() is DecisionState.WAITING:
                self._schedule(waiting_decision)
                return
            del self._waiting_decisions[decision.number]
            waiting_decision.end()
            self._send(answer_to(waiting_decision.request_id, self._decision_answer(decision)))

    def _schedule(self, waiting_decision: _WaitingDecision) -> None:
        """Make sure that a decision is continued at the next instant at which time alone can end its wait."""
        decision, check_s = waiting_decision.decision, waiting_decision.decision.next_check_s()
        if waiting_decision.timer.is_cancelled or check_s < waiting_decision.timer.instant_s:
            waiting_decision.timer.cancel()
            waiting_decision.timer = self._clock.call_at(check_s, lambda: self._resume(decision))

    def _decision_answer(self, decision: PendingDecision | PendingPreview) -> PlainData:
        if decision.state is DecisionState.LOOKING:
            self._looking_decisions[decision.number] = decision
            if len(self._looking_decisions) > MAX_LOOKING_DECISIONS:
                self._looking_decisions.pop(next(iter(self._looking_decisions))).abandon("no value was sent")
        answer = {"decision": decision.number, "answered": decision.state is DecisionState.ANSWERED}
        if isinstance(decision, PendingPreview):
            return {**answer, "preview": plain_preview(decision.answer), "look": list(decision.missing[:1])}
        return {**answer, "reading": plain_reading(decision.reading)}

    def _found(self, decision: int, value: object = None, raised: str | None = None) -> PlainData:
        if decision not in self._looking_decisions:
            raise MessageError(f"no decision {decision} waits for an acquired value")
        looking_decision = self._looking_decisions.pop(decision)
        if raised is not None:
            looking_decision.abandon(raised)
            return {}
        looking_decision.record_result(value)
        return self._decision_answer(looking_decision) if isinstance(looking_decision, PendingPreview) else {}

    def _check_lease(self) -> None:
        """End the session if its lease is over; otherwise check again when the lease after the last message ends."""
        with self._lock:
            if self._end_reason:
                return
            end_s = self._last_message_s + self._lease_s
            if end_s <= self._clock.now_s():
                reason = f"no message was received for {self._lease_s:g} s"
                self.close(reason)
                self._send(notice("lease_over", message=reason))
            else:
                self._lease.cancel()
                self._lease = self._clock.call_at(end_s, self._check_lease)

    def _check_alive(self) -> None:
        if self._end_reason:
            raise LeaseError(f"the session is over: {self._end_reason}; connect again and send `hello`")

    def _agent(self, name: str) -> Agent[Any, Any]:
        """Return the handle of an agent; the session keeps this handle until the session is over."""
        if name not in self._agents:
            self._agents[name] = self._codra.agent(name)
        return self._agents[name]

    def _variable(self, name: str) -> VariableModel:
        if name not in self._variables:
            raise unknown_name_error("variable", name, self._variables)
        return self._variables[name]

    def _skill(self, name: str) -> str:
        if name not in self._skills:
            raise unknown_name_error("skill", name, self._skills)
        return name

    def _check_begun(self, number: int) -> None:
        if number not in self._running_skills:
            raise MessageError(f"no skill in progress has number {number}")


def _check_number(what: str, elements: Sized, maximum: int) -> None:
    if len(elements) >= maximum:
        raise ValueError(f"a session may have at most {maximum} {what}")


@dataclass(slots=True, kw_only=True)
class _WaitingDecision:
    """A decision that is answered later. The timer continues it when time alone can end its wait."""

    decision: PendingDecision | PendingPreview
    request_id: int | str | None
    timer: Timer
    subscriptions: tuple[Subscription, ...]

    def end(self) -> None:
        self.timer.cancel()
        for subscription in self.subscriptions:
            subscription.unsubscribe()
