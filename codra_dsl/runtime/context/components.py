"""The parts of a context manager, and their connections."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from codra_dsl.logic import Value
from codra_dsl.runtime.callbacks import Subscriptions
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.context.commands import Commands
from codra_dsl.runtime.context.host_commands import HostCommands
from codra_dsl.runtime.context.model import ContextModel
from codra_dsl.runtime.context.pose_conditions import PoseConditions
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.journal import EventLog, EventWriter
from codra_dsl.runtime.knowledge import ContextLink, Knowledge, KnowledgeModel
from codra_dsl.runtime.locked_clock import LockedClock
from codra_dsl.runtime.observers.event_triggers import EventTriggers
from codra_dsl.runtime.observers.expectations import Expectations
from codra_dsl.runtime.observers.forest import Forest
from codra_dsl.runtime.observers.observer import Observer
from codra_dsl.runtime.observers.services import ObserverServices
from codra_dsl.runtime.observers.store import Store
from codra_dsl.runtime.perception import Function, Perception, imported
from codra_dsl.runtime.perception.hosts import Hosts
from codra_dsl.runtime.perception.site_handles import with_site_handles
from codra_dsl.runtime.perception.slots import Slots
from codra_dsl.runtime.values.cell import Reading, Reason
from codra_dsl.runtime.values.derived import with_inputs
from codra_dsl.runtime.values.model import Algorithm


class Components:
    """The parts of a context manager.

    Attributes:
        lock: held by code that only reads; `clock` holds it during each change.
        unlocked_clock: the clock of real or simulated time; it holds no lock while its events run.
        clock: a clock with the same time, whose events are steps under the lock.
        skills: the skills by name.
    """

    def __init__(
        self,
        model: ContextModel,
        *,
        clock: Clock,
        resources: Mapping[str, object],
        record: EventLog,
        seed: int,
        find: Callable[[Algorithm], Function],
        hosts_here: bool,
    ) -> None:
        """Create and connect all parts. The arguments and the errors are those of `ContextManager`."""
        self.unlocked_clock = clock
        self.clock = LockedClock(clock, new_lock())
        self.lock = self.clock.without_step()
        self.skills = {skill.name: skill for skill in model.skills}
        self.event_writer = EventWriter(record, self.clock, self.clock.position)
        self.clock.on_late_event = lambda: self.event_writer.write_input("clock", "late")
        self.store = Store(model.variables, self.clock, self.event_writer, self.notify_readers)
        self.slots = Slots(
            self.clock,
            {resource.name: resource for resource in model.resources},
            order_version=lambda: self.commands.urgency_version,
        )
        self.perception = Perception(
            clock=self.clock,
            slots=self.slots,
            make_handles=lambda names: with_site_handles(
                [resource for resource in model.resources if resource.name in names], resources, clock
            ),
            seed=seed,
            event_writer=self.event_writer,
            hosts=Hosts(self.clock, are_here=hosts_here or find is not imported),
            find_function=find,
        )
        self.subscriptions = Subscriptions(clock, self.lock)
        self.expectations = Expectations(self.store, self.clock, self.event_writer, self.subscriptions.notify_verdict)
        self.event_triggers = EventTriggers()
        self.forest = Forest(
            model.observers, self._services(), self.clock, self.store.write_all, self.forget_variables_of
        )
        observers = self.forest.observers.values()
        self.perception.prepare(branch.algorithm for observer in observers for branch in observer.branches)
        self.hosts = HostCommands(
            self.perception.hosts, clock=self.clock, event_writer=self.event_writer, forest=self.forest
        )
        self.commands = Commands(
            clock=self.clock,
            event_writer=self.event_writer,
            store=self.store,
            forest=self.forest,
            slots=self.slots,
            expectations=self.expectations,
            event_triggers=self.event_triggers,
            skills=self.skills,
            explain=self.with_obstacle,
        )

    def _services(self) -> ObserverServices:
        return ObserverServices(
            cells=self.store.cells,
            variables=self.store.variables,
            perception=self.perception,
            event_triggers=self.event_triggers,
            event_writer=self.event_writer,
            clock=self.clock,
            urgency=lambda observer: self.commands.urgency(observer),  # noqa: PLW0108 - `commands` is set later
            is_asked_for=lambda variable: self.forest.is_asked_for(variable, self.commands.declarations),
        )

    def create_knowledge(self, model: KnowledgeModel) -> Knowledge:
        """Return a new knowledge graph that shares the variables, the steps and the journal of the context manager."""
        context_link = ContextLink(
            variables=tuple(variable for variable in self.store.variables.values() if variable.pose_condition is None),
            clock=self.clock,
            event_writer=self.event_writer,
            write_all=self.store.write_all,
        )
        knowledge = Knowledge(model, clock=self.unlocked_clock, context_link=context_link)
        self.store.mirror, self.store.mirror_override = knowledge.mirror, knowledge.mirror_override
        PoseConditions(self.store.variables.values(), knowledge, self.clock, self.store)
        return knowledge

    def obstacle(self, name: str) -> str:
        """Return why a variable, known or unknown, cannot be observed now; empty if an algorithm can look."""
        obstacle, variable = self.forest.obstacle(name), self.store.variables[name]
        if variable.pose_condition is not None:
            return "it follows from poses"
        if variable.derived is not None:
            inputs = with_inputs((name,), self.store.cells)
            plain_inputs = sorted(other for other in inputs if self.store.variables[other].derived is None)
            obstacles = ((input_name, self.obstacle(input_name)) for input_name in plain_inputs)
            return "; ".join(f"{input_name}: {text}" for input_name, text in obstacles if text)
        return f"only {' or '.join(variable.sources)} may write it" if obstacle is None else obstacle

    def with_obstacle(self, reading: Reading[Value]) -> Reading[Any]:
        """Return a reading with a detail that states why the variable cannot be observed now.

        The detail is added only if the variable was never observed or is stale, and the reading has no detail yet.
        """
        if reading.reason not in (Reason.NEVER_OBSERVED, Reason.STALE) or reading.detail:
            return reading
        return replace(reading, detail=self.obstacle(reading.name))

    def notify_readers(self, name: str, is_renewed: bool) -> None:
        """Notify all readers of a variable that the variable has another reading."""
        self.forest.changed(name, is_renewed)
        self.expectations.changed(name)
        self.subscriptions.notify_change(name, self.store.reading)
        self.unlocked_clock.notify()

    def forget_variables_of(self, observer: Observer) -> None:
        """Forget the variables of a stopped observer that are declared with `forget`."""
        self.store.forget(observer.model.identifies, observer.name)
