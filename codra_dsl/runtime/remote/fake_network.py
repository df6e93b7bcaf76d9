"""A network in simulated time, for tests: links with delays and faults that a seed determines."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from random import Random
from typing import Any

from codra_dsl.runtime.clock import Clock, Timer
from codra_dsl.runtime.context.context import ContextManager
from codra_dsl.runtime.remote.json_lines import RESPONSE_TIMEOUT_S
from codra_dsl.runtime.remote.links import Lose, Receive
from codra_dsl.runtime.remote.ordering import GAP_TIMEOUT_S, Numbering, Ordering
from codra_dsl.runtime.remote.protocol import PlainData
from codra_dsl.runtime.remote.session import Session, open_session


@dataclass(frozen=True, slots=True, kw_only=True)
class Faults:
    """How a network treats messages.

    Attributes:
        delay_s: the shortest and the longest delay of a message. Different delays can change the order of messages.
        loss: the probability that a message is lost.
        duplication: the probability that a message arrives twice.
    """

    delay_s: tuple[float, float] = (0.0, 0.0)
    loss: float = 0.0
    duplication: float = 0.0


class FakeNetwork:
    """A network between programs and managers. Everything happens in one thread, in events of the clock.

    Without a delay, messages arrive within the call that sends them.

    Attributes:
        is_cut: whether all messages are lost.
    """

    def __init__(self, clock: Clock, *, seed: int = 0, faults: Faults | None = None) -> None:
        """Create a network without links.

        Args:
            clock: the clock of the network.
            seed: determines delays and faults.
            faults: the faults; by default there are none.
        """
        self.is_cut = False
        self._clock = clock
        self._random = Random(f"{seed} network")
        self._faults = Faults() if faults is None else faults

    def connect(self, codra: ContextManager[Any, Any]) -> FakeLink:
        """Return a link to a manager.

        Raises:
            ConnectionError: if the network is cut.
        """
        if self.is_cut:
            raise ConnectionError("the network is cut")
        return FakeLink(self, self._clock, codra)

    def transmit(self, deliver: Callable[[], None]) -> None:
        """Call `deliver` after a delay: once, twice or never."""
        if self.is_cut or self._random.random() < self._faults.loss:
            return
        for _ in range(2 if self._random.random() < self._faults.duplication else 1):
            delay_s = self._random.uniform(*self._faults.delay_s)
            if delay_s == 0.0:
                deliver()
            else:
                self._clock.call_at(self._clock.now_s() + delay_s, lambda: None if self.is_cut else deliver())


class FakeLink:
    """A link over a fake network, with the session at its other end."""

    token = None
    response_timeout_s = RESPONSE_TIMEOUT_S

    def __init__(self, network: FakeNetwork, clock: Clock, codra: ContextManager[Any, Any]) -> None:
        """Open a session of the manager."""
        self._network = network
        self._clock = clock
        self._is_closed = False
        self._lose: Lose = lambda _: None
        self._session: Session = open_session(codra, self._send_to_program)
        self._to_manager = _Direction(network, clock, self._session.receive, self._end)
        self._to_program = _Direction(network, clock, lambda _: None, self._end)

    def open(self, receive: Receive, lose: Lose) -> None:
        """Begin to receive messages."""
        self._lose = lose
        self._to_program = _Direction(self._network, self._clock, receive, self._end)

    def send(self, message: PlainData) -> None:
        """Send a message to the manager."""
        if not self._is_closed:
            self._to_manager.send(message)

    def close(self) -> None:
        """Close the program's end. The manager learns it from the end of the lease."""
        self._is_closed = True

    def _send_to_program(self, message: PlainData) -> None:
        if not self._is_closed:
            self._to_program.send(message)

    def _end(self, because: str) -> None:
        """End both sides, because a message is lost for good."""
        self._session.close(because)
        if not self._is_closed:
            self._is_closed = True
            self._lose(because)


class _Direction:
    """The messages from one end of a link to the other, which arrive in order, or not at all after a loss."""

    def __init__(self, network: FakeNetwork, clock: Clock, receive: Receive, lose: Lose) -> None:
        self._network = network
        self._clock = clock
        self._numbering, self._ordering = Numbering(), Ordering()
        self._receive = receive
        self._lose = lose
        self._gap_timer = Timer(math.inf, lambda: None)

    def send(self, message: PlainData) -> None:
        """Send a message."""
        number = self._numbering.next()
        self._network.transmit(lambda: self._arrive(number, message))

    def _arrive(self, number: int, message: PlainData) -> None:
        for ready_message in self._ordering.add(number, message):
            self._receive(ready_message)
        self._gap_timer.cancel()
        if self._ordering.has_gap:
            self._gap_timer = self._clock.call_at(
                self._clock.now_s() + GAP_TIMEOUT_S, lambda: self._lose("a message was lost")
            )
