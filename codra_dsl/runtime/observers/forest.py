"""The forest F: all observers, connected by the context that they share (P1, Equation 11), ticked after changes.

The paper ticks every tree each second. Here a tree is ticked when it is due, when a variable that it reads has
changed, when a job has ended, and when the result of a comparison with an age changes. This is less work than a tick of
every tree at every instant, and the outcome is the same: `tests/runtime/observers/test_by_change.py` compares the two.
A variable has changed when it has another value. Newer evidence for the same value is a change only for the trees that
read the age of the variable.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping, Sequence

from codra_dsl.logic import Value
from codra_dsl.runtime.clock import Clock, Timer
from codra_dsl.runtime.journal import EventWriter, Kind
from codra_dsl.runtime.observers.activation import Activation
from codra_dsl.runtime.observers.observer import Observer, ObserverModel
from codra_dsl.runtime.observers.services import ObserverServices
from codra_dsl.runtime.perception import described
from codra_dsl.runtime.values.cell import Reading
from codra_dsl.runtime.values.derived import derived_cells_among, with_inputs

MAX_ROUNDS = 100
"""The largest number of rounds at one instant. If feedback still causes changes then, the next round has to wait."""

ROUND_PAUSE_S = 0.01
"""How long the next round waits after `MAX_ROUNDS` rounds."""


class Forest:
    """Starts, stops and ticks observers. Callers hold the context manager's lock."""

    def __init__(
        self,
        models: Sequence[ObserverModel],
        services: ObserverServices,
        clock: Clock,
        commit: Callable[[Iterable[Reading[Value]]], None],
        on_stop: Callable[[Observer], None],
    ) -> None:
        """Build all trees.

        Args:
            models: the observers.
            services: the part of the context manager that observers use.
            clock: real or simulated time.
            commit: called after each round in which observers wrote readings, with these readings.
            on_stop: called for each observer that has stopped.
        """
        self._clock = clock
        self._cells = services.cells
        self._event_writer: EventWriter = services.event_writer
        self._commit = commit
        self._on_stop = on_stop
        self._observers = {model.name: Observer(model, services, self.request_tick) for model in models}
        self._activation = Activation(
            {name: observer.model.identifies for name, observer in self._observers.items()},
            {name: observer.needs() for name, observer in self._observers.items()},
            self._start,
            self._stop,
        )
        self._position_by_name = {name: position for position, name in enumerate(self._activation.order)}
        self._readers, self._readers_of_age = self._find_readers()
        self._on_event_observers = [
            observer
            for observer in map(self._observers.__getitem__, self._activation.order)
            if observer.on_event_variables
        ]
        self._observer_by_variable = {
            name: observer for observer in self._observers.values() for name in observer.model.identifies
        }
        self._observers_by_need: dict[str, list[Observer]] = {}
        for observer in self._observers.values():
            for name in observer.on_event_needs:
                self._observers_by_need.setdefault(name, []).append(observer)
        self._supplier_names_by_observer = {
            name: self._supplier_names(observer) for name, observer in self._observers.items()
        }
        self._derived_readers: dict[str, list[str]] = {}
        for cell in derived_cells_among(self._cells, self._cells):
            for name in with_inputs((cell.reading.name,), self._cells):
                self._derived_readers.setdefault(name, [name]).append(cell.reading.name)
        self._names_to_tick: set[str] = set()
        self._timers: dict[str, Timer] = {}
        self._round_timer: Timer | None = None

    @property
    def observers(self) -> Mapping[str, Observer]:
        """Return a mapping from names to observers."""
        return self._observers

    def running(self) -> frozenset[str]:
        """Return the names of the observers that run."""
        return self._activation.running()

    def obstacle(self, variable: str) -> str | None:
        """Return why a variable cannot be observed now; empty if it can be observed, None if it has no observer.

        Any thread may call this, without the lock.
        """
        observer = self._observer_by_variable.get(variable)
        if observer is None:
            return None
        return (
            observer.obstacle(variable) if observer.is_wanted else f"{observer.name} does not run: declare {variable}"
        )

    def declare(self, variable: str) -> None:
        """Start the observers for a variable that enters C_E(t) (P1, Algorithm 1).

        For a derived variable, these are the observers of its inputs.

        If the variable has `refresh: on_event`, its observer may run already because other observers need the variable.
        Then the declaration can make the variable due, so the observer is ticked.
        """
        for name in self._observed_inputs(variable):
            self._activation.declare(name)
            if name in self._observers_by_need:
                self.request_tick(self._observer_by_variable[name])

    def withdraw(self, variable: str) -> None:
        """Stop the observers that are no longer needed when a variable leaves C_E(t)."""
        for name in self._observed_inputs(variable):
            self._activation.withdraw(name)

    def changed(self, variable: str, is_renewed: bool) -> None:
        """Tick the readers of a variable whose present reading or history has changed.

        Args:
            variable: the name of the variable.
            is_renewed: whether the variable only has newer evidence for the same value. This affects only conditions on
                the age of the variable.
        """
        readers = self._readers_of_age if is_renewed else self._readers
        for observer in readers.get(variable, ()):
            if observer.is_wanted:
                self._names_to_tick.add(observer.name)
                if self._round_timer is None:
                    self._schedule_rounds()

    def is_asked_for(self, variable: str, declarations: Container[str]) -> bool:
        """Return whether a variable is declared, or needed, directly or indirectly, by an observer that is due to look.

        If observers need each other's variables in a cycle, these needs alone do not count: a declaration or observer
        outside the cycle must ask for one variable of the cycle.
        """
        visited_variables, pending_variables = {variable}, [variable]
        while pending_variables:
            name = pending_variables.pop()
            derived_readers = self._derived_readers.get(name)
            if name in declarations or (derived_readers and any(map(declarations.__contains__, derived_readers))):
                return True
            for observer in self._observers_by_need.get(name, ()):
                for branch in observer.branches_asking_for(name):
                    if not branch.is_on_event:
                        return True  # a periodic look needs its preconditions in any case
                    due_variables = set(branch.due_variables()) - visited_variables
                    visited_variables |= due_variables
                    pending_variables.extend(due_variables)
        return False

    def _observed_inputs(self, variable: str) -> list[str]:
        """Return a variable if an observer identifies it; of a derived variable, its inputs that have observers."""
        return sorted(name for name in with_inputs((variable,), self._cells) if name in self._observer_by_variable)

    def look_again(self) -> None:
        """Tick the running observers that have variables with `refresh: on_event`, because they may be due now."""
        for observer in self._on_event_observers:
            if observer.is_wanted:
                self.request_tick(observer)

    def request_tick(self, observer: Observer) -> None:
        """Tick an observer in the next round, at this instant. If the observer does not run, this has no effect."""
        if not observer.is_wanted:
            return
        self._names_to_tick.add(observer.name)
        if self._round_timer is None:
            self._schedule_rounds()

    def _schedule_rounds(self) -> None:
        self._round_timer = self._clock.call_at(self._clock.now_s(), self._run_until_quiet)

    def _run_until_quiet(self) -> None:
        """Run rounds at this instant until nothing changes.

        In a round, observers are ticked in order on one state of the context; then their readings are committed.
        """
        try:
            is_quiet = self._run_rounds()
        except BaseException:
            self._round_timer = None
            raise
        self._round_timer = (
            None if is_quiet else self._clock.call_at(self._clock.now_s() + ROUND_PAUSE_S, self._run_until_quiet)
        )

    def _run_rounds(self) -> bool:
        for _ in range(MAX_ROUNDS):
            if not self._names_to_tick:
                return True
            names_with_suppliers = self._names_to_tick.union(
                *map(self._supplier_names_by_observer.__getitem__, self._names_to_tick)
            )
            names, self._names_to_tick = sorted(names_with_suppliers, key=self._position_by_name.__getitem__), set()
            now_s = self._clock.now_s()
            readings = [reading for name in names for reading in self._tick(self._observers[name], now_s)]
            if readings:
                self._commit(readings)
        return False

    def _tick(self, observer: Observer, now_s: float) -> list[Reading[Value]]:
        try:
            readings = observer.tick(now_s)
        except Exception as error:  # noqa: BLE001 - one broken tree must not stop the forest
            readings = observer.fail(described(error))
            self._event_writer.write(Kind.OBSERVER, observer.name, "failed", message=described(error))
        self._schedule_tick(observer, observer.next_tick_s())
        return readings

    def _schedule_tick(self, observer: Observer, instant_s: float | None) -> None:
        """Schedule a tick of an observer, unless an earlier tick is scheduled, which then schedules the next one."""
        timer = self._timers.get(observer.name)
        if instant_s is not None and (timer is None or timer.instant_s > instant_s):
            if timer is not None:
                timer.cancel()
            self._timers[observer.name] = self._clock.call_at(instant_s, lambda: self._request_timed_tick(observer))

    def _request_timed_tick(self, observer: Observer) -> None:
        # A timer may fire while `_schedule_tick` replaces it. Then the next line removes the entry of the new timer.
        # This is harmless: the tick schedules the next one.
        self._timers.pop(observer.name, None)
        self.request_tick(observer)

    def _start(self, name: str) -> None:
        observer = self._observers[name]
        observer.start()
        self._event_writer.write(Kind.OBSERVER, name, "started")
        self.request_tick(observer)

    def _stop(self, name: str) -> None:
        observer = self._observers[name]
        observer.stop()
        self._event_writer.write(Kind.OBSERVER, name, "stopped")
        self._tick(observer, self._clock.now_s())  # a last tick: the control flag fails, which cancels its jobs
        self._on_stop(observer)

    def _supplier_names(self, observer: Observer) -> frozenset[str]:
        """Return the names of the observers of all variables with `refresh: on_event` that an observer needs.

        Variables that are needed indirectly are included. When the observer is ticked, the returned observers are
        ticked as well.
        """
        supplier_names: set[str] = set()
        pending_observers = [observer]
        while pending_observers:
            names = {
                self._observer_by_variable[name].name
                for name in pending_observers.pop().on_event_needs
                if name in self._observer_by_variable
            }
            pending_observers.extend(self._observers[name] for name in names - supplier_names)
            supplier_names |= names
        return frozenset(supplier_names)

    def _find_readers(self) -> tuple[dict[str, list[Observer]], dict[str, list[Observer]]]:
        """Return the observers that read each variable, and the observers that depend on the age of each variable."""
        readers: dict[str, list[Observer]] = {}
        readers_of_age: dict[str, list[Observer]] = {}
        for name in self._activation.order:
            observer = self._observers[name]
            for need in observer.watched_variables():
                readers.setdefault(need, []).append(observer)
            # whether the observer looks depends on the age of its own variables
            own_variables = observer.on_event_variables if observer.on_event_needs else ()
            for need in sorted({*observer.age_sensitive_needs(), *own_variables}):
                readers_of_age.setdefault(need, []).append(observer)
        return readers, readers_of_age
