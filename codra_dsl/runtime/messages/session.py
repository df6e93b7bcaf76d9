"""One main execution that speaks in messages: what it declares, its decisions, what it has subscribed to, its lease.

A session does what a program does with the context manager, step by step and without waiting: a decision that may wait
is answered later. What it declares is withdrawn when it leaves, and when nothing was heard of it for as long as its
lease lasts.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from codra_dsl.runtime.agents import Agent
from codra_dsl.runtime.cell import Reading
from codra_dsl.runtime.clock import Clock, Timer
from codra_dsl.runtime.declarations import MAIN
from codra_dsl.runtime.messages.protocol import (
    ANSWERED,
    LeaseError,
    MessageError,
    Plain,
    Request,
    answer_to,
    error_to,
    id_of,
    notice,
    plain_reading,
    request_of,
)
from codra_dsl.runtime.model import VariableModel
from codra_dsl.runtime.names import unknown
from codra_dsl.runtime.question import Question, Step
from codra_dsl.runtime.subscriptions import Subscription

if TYPE_CHECKING:
    from codra_dsl.runtime.context import ContextManager

MOST_LOOKING = 1_000
"""Decisions of which a session need not have said yet what it found; then the oldest counts as given up."""

LEASE_S = 5.0
"""How long a session lives without a word from its main execution, unless it asks for another time."""

Send = Callable[[Plain], None]


class Session:
    """The manager's side of one main execution."""

    def __init__(self, codra: ContextManager[Any, Any], clock: Clock, party: str, send: Send) -> None:
        """Begin a session; use `ContextManager.session`.

        Args:
            codra: is asked.
            clock: the one that the context manager was given: it ends the lease and the waits.
            party: under whose name the session declares.
            send: takes answers and notices; it must neither wait nor raise.
        """
        self.party = party
        self._codra = codra
        self._inputs = codra.inputs
        self._variables = {variable.name: variable for variable in codra.model.variables}
        self._skills = frozenset(skill.name for skill in codra.model.skills)
        self._clock = clock
        self._send = send
        self._lock = threading.RLock()
        self._lease_s = LEASE_S
        self._heard_s = clock.now_s()
        self._over = ""
        self._begun: set[int] = set()
        self._looking: dict[int, Question] = {}
        self._waiting: dict[int, _Wait] = {}
        self._subscriptions: dict[int, Subscription] = {}
        self._subscribed = 0
        self._agents: dict[str, Agent[Any, Any]] = {}
        self._lease = Timer(math.inf, _nothing)
        self._watch()

    @property
    def is_over(self) -> bool:
        """Return whether the session has ended."""
        return bool(self._over)

    def receive(self, message: object) -> None:
        """Take one message; its answer goes through `send`, at once or, for a decision that waits, later."""
        with self._lock:
            try:
                request = request_of(message)
                self._check_alive()
                self._heard_s = self._clock.now_s()
                answer = self._do(request)
            except ANSWERED as error:
                self._send(error_to(id_of(message), error))
                return
            if answer is not None:
                self._send(answer_to(request.id, answer))

    def close(self, because: str = "the session was closed") -> None:
        """Withdraw all that the session declares; harmless when it is over."""
        with self._lock:
            if self._over:
                return
            self._over = because
            self._inputs.leave(self.party)
            self._lease.cancel()
            for subscription in self._subscriptions.values():
                subscription.unsubscribe()
            for wait in self._waiting.values():
                wait.end()
            for question in (*(wait.question for wait in self._waiting.values()), *self._looking.values()):
                question.abandon(LeaseError.__name__)
            for agent in self._agents.values():
                agent.close()
            for memory in (self._subscriptions, self._waiting, self._looking, self._agents):
                memory.clear()

    # Requests, each by its name in `REQUESTS`

    def _do(self, request: Request) -> Plain | None:
        if request.ask == "decide":
            return self._decide(request.id, **request.fields)
        handler: Callable[..., Plain] = getattr(self, f"_{request.ask}")
        return handler(**request.fields)

    def _hello(self, lease_s: float = LEASE_S) -> Plain:
        self._lease_s = lease_s
        self._watch()
        return {
            "spec": self._codra.model.name,
            "party": self.party,
            "lease_s": lease_s,
            "now_s": self._clock.now_s(),
            "variables": list(self._variables),
            "skills": sorted(self._skills),
        }

    def _keep(self) -> Plain:
        return {"now_s": self._clock.now_s()}

    def _declare(self, variable: str, value: object = None) -> Plain:
        content = None if value is None else self._variable(variable).type.convert(value)
        self._inputs.declare(self._variable(variable).name, party=self.party)
        if content is not None:
            self._inputs.write(variable, content, MAIN, None)
        return {}

    def _withdraw(self, variable: str) -> Plain:
        self._inputs.withdraw(self._variable(variable).name, party=self.party)
        return {}

    def _expect(self, skills: list[str]) -> Plain:
        self._inputs.expect([self._skill(name) for name in skills], party=self.party)
        return {}

    def _begin(self, skill: str) -> Plain:
        number = self._inputs.begin(self._skill(skill), party=self.party)
        self._begun.add(number)
        return {"number": number}

    def _act(self, number: int) -> Plain:
        self._check_begun(number)
        self._inputs.act(number)
        return {}

    def _acted(self, number: int) -> Plain:
        self._check_begun(number)
        self._inputs.acted(number)
        return {}

    def _finish(self, number: int) -> Plain:
        self._check_begun(number)
        self._begun.discard(number)
        self._inputs.finish(number)
        return {}

    def _get(self, variable: str) -> Plain:
        return {"reading": plain_reading(self._codra.get(variable))}

    def _set(self, variable: str, value: object, evidence_s: float | None = None, agent: str | None = None) -> Plain:
        writer = self._codra if agent is None else self._agent(agent)
        writer.set(variable, value, evidence_s=evidence_s)
        return {}

    def _subscribe(self, variables: list[str]) -> Plain:
        names = list(dict.fromkeys(self._variable(name).name for name in variables))
        self._subscribed += 1
        number = self._subscribed

        def tell(reading: Reading[Any]) -> None:
            with self._lock:  # after the answer that tells the number, and not after that to `unsubscribe`
                if number in self._subscriptions:
                    self._send(notice("reading", subscription=number, reading=plain_reading(reading)))

        self._subscriptions[number] = self._codra.subscribe(names, tell)
        return {"subscription": number}

    def _unsubscribe(self, subscription: int) -> Plain:
        if subscription not in self._subscriptions:
            raise MessageError(f"there is no subscription {subscription}")
        self._subscriptions.pop(subscription).unsubscribe()
        return {}

    def _leave(self) -> Plain:
        self.close("the main execution has left")
        return {}

    # Decisions

    def _decide(self, request_id: int | str | None, variable: str, **asked: Any) -> Plain | None:
        question = self._codra.ask(variable, **asked)
        if question.step is not Step.WAITING:
            return self._settled(question)
        self._waiting[question.number] = _Wait(
            question=question,
            request_id=request_id,
            timer=self._clock.call_at(self._clock.now_s() + asked["wait_up_to_s"], lambda: self._resume(question)),
            following=self._codra.follow(variable, lambda: self._resume(question)),
        )
        self._resume(question)  # what came before it was followed called nobody back
        return None

    def _resume(self, question: Question) -> None:
        """Answer a decision that has waited, if it is met or has waited long enough."""
        with self._lock:
            if question.number not in self._waiting or question.poll() is Step.WAITING:
                return
            wait = self._waiting.pop(question.number)
            wait.end()
            self._send(answer_to(wait.request_id, self._settled(question)))

    def _settled(self, question: Question) -> Plain:
        if question.step is Step.LOOKING:
            self._looking[question.number] = question
            if len(self._looking) > MOST_LOOKING:
                self._looking.pop(next(iter(self._looking))).abandon("not told")
        answered = {"decision": question.number, "answered": question.step is Step.ANSWERED}
        return {**answered, "reading": plain_reading(question.reading)}

    def _found(self, decision: int, value: object = None, raised: str | None = None) -> Plain:
        if decision not in self._looking:
            raise MessageError(f"no decision {decision} waits for what was found")
        question = self._looking.pop(decision)
        if raised is None:
            question.found(value)
        else:
            question.abandon(raised)
        return {}

    # Within

    def _watch(self) -> None:
        """End the session when its lease is over; a word that came meanwhile has moved that end."""
        with self._lock:
            if self._over:
                return
            end_s = self._heard_s + self._lease_s
            if end_s <= self._clock.now_s():
                because = f"nothing was heard of it for {self._lease_s:g} s"
                self.close(because)
                self._send(notice("lease_over", message=because))
            else:
                self._lease.cancel()
                self._lease = self._clock.call_at(end_s, self._watch)

    def _check_alive(self) -> None:
        if self._over:
            raise LeaseError(f"the session is over: {self._over}; say hello on a new one")

    def _agent(self, name: str) -> Agent[Any, Any]:
        """Return the handle of an agent, which the session then has until it is over."""
        if name not in self._agents:
            self._agents[name] = self._codra.agent(name)
        return self._agents[name]

    def _variable(self, name: str) -> VariableModel:
        if name not in self._variables:
            raise unknown("variable", name, self._variables)
        return self._variables[name]

    def _skill(self, name: str) -> str:
        if name not in self._skills:
            raise unknown("skill", name, self._skills)
        return name

    def _check_begun(self, number: int) -> None:
        if number not in self._begun:
            raise MessageError(f"no skill under way has number {number}")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Wait:
    """A decision that is answered later."""

    question: Question
    request_id: int | str | None
    timer: Timer
    following: Subscription

    def end(self) -> None:
        self.timer.cancel()
        self.following.unsubscribe()


def _nothing() -> None:
    pass
