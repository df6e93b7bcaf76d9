"""What hosts tell the context manager: that they are connected or lost, and how their jobs go.

A step of a host is an input, as a command of a program is one. So a replay needs no host.
"""

from __future__ import annotations

from collections.abc import Mapping

from codra_dsl.runtime.errors import unknown_name_error
from codra_dsl.runtime.journal import EventWriter, Kind
from codra_dsl.runtime.locked_clock import LockedClock
from codra_dsl.runtime.observers.forest import Forest
from codra_dsl.runtime.perception import Failure, Interval
from codra_dsl.runtime.perception.hosts import HostConnection, Hosts, JobKey, obstacle_text


class HostCommands:
    """The steps of hosts. No step waits.

    Attributes:
        names: the hosts that the spec names.
    """

    def __init__(self, hosts: Hosts, *, clock: LockedClock, event_writer: EventWriter, forest: Forest) -> None:
        self.names = frozenset(host for observer in forest.observers.values() for host in observer.hosts)
        self._hosts = hosts
        self._clock = clock
        self._event_writer = event_writer
        self._forest = forest

    def connect(self, host: str, connection: HostConnection | None) -> None:
        """Let a host execute the jobs of its algorithms.

        Args:
            host: the name of the host.
            connection: sends the orders to the host; None if its functions run in this program, or in a replay.

        Raises:
            UnknownNameError: if no algorithm has this host.
            ValueError: if the host is connected already.
        """
        if host not in self.names:
            raise unknown_name_error("host", host, sorted(self.names))
        with self._clock:
            self._hosts.connect(host, connection)
            self._event_writer.write_input(host, "connected")
            self._event_writer.write(Kind.HOST, host, "connected")
            self._tick_observers(host)

    def disconnect(self, host: str, because: str) -> None:
        """Note that a host is lost: its jobs end, and its algorithms cannot look until it is connected again."""
        with self._clock:
            self._event_writer.write_input(host, "lost", message=because)
            self._event_writer.write(Kind.HOST, host, "lost", message=because)
            self._tick_observers(host)
            self._hosts.disconnect(host, because)

    def refuse(self, host: str, because: str) -> None:
        """Note why a host that is not connected may not connect, unless this was the last reason."""
        with self._clock:
            obstacle = self._hosts.obstacle(host)
            if host in self.names and obstacle and obstacle != obstacle_text(host, because):
                self.disconnect(host, because)

    def report_evidence(self, host: str, key: JobKey, interval: Interval) -> None:
        """Note when the evidence of a job was taken.

        Raises:
            ValueError: if the interval does not lie in the past.
        """
        with self._clock:
            self._hosts.report_evidence(host, key, interval)

    def end(self, host: str, key: JobKey, outcome: Mapping[str, object] | Failure) -> None:
        """Deliver the outcome of a job: the values that its function returned, or a failure."""
        with self._clock:
            self._hosts.end(host, key, outcome)

    def _tick_observers(self, host: str) -> None:
        for observer in self._forest.observers.values():
            if host in observer.hosts:
                observer.request_tick()
