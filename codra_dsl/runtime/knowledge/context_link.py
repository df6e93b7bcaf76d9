"""What a graph shares with the context manager that it belongs to: variables, steps, and the journal."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from codra_dsl.logic import Value
from codra_dsl.runtime.clock import LockedClock
from codra_dsl.runtime.journal import EventWriter, Kind
from codra_dsl.runtime.knowledge.change_set import ChangeSet
from codra_dsl.runtime.knowledge.operations import Operation, Verb, operations_text
from codra_dsl.runtime.values.cell import Reading
from codra_dsl.runtime.values.model import NotOfTypeError, VariableModel


class Refused(NamedTuple):
    """A write that was refused, as a journal tells it.

    Attributes:
        subject: what it was about.
        why: who may.
        variable: the context-variable that it was about; empty if it was about none.
        value: of the variable; None if it was none of its values.
    """

    subject: str
    why: str
    variable: str = ""
    value: Value | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ContextLink:
    """What a graph shares with a context manager.

    A context-variable is an attribute of a node: both sides have the same readings. Whoever writes either holds the
    one lock of the steps, so there is no order of locks to keep.

    Attributes:
        variables: of the context.
        steps: make each write a step, and let deadlines be events.
        event_writer: tells the journal.
        write: takes readings of variables, and gives them back to the graph's `mirror`.
    """

    variables: Sequence[VariableModel]
    steps: LockedClock
    event_writer: EventWriter
    write: Callable[[Reading[Value]], None]

    def write_input(self, agent: str, operations: Sequence[Operation]) -> None:
        """Tell the journal what an agent does, before anybody can see it."""
        if operations and self.event_writer.takes_inputs:
            self.event_writer.write_input(agent, "graph", operations=operations_text(operations))

    def commit(self, change_set: ChangeSet, version: int) -> None:
        """Let the context have what was written of its variables, and tell what else was done."""
        for reading in change_set.shared:
            self.write(reading)
        for name, what, details in change_set.notes or ():
            self.event_writer.write(Kind.KNOWLEDGE, name, what, version=version, **details)

    def refuse(self, agent: str, refused: Refused) -> None:
        """Tell that a write was refused; of a context-variable, among what became of that as well."""
        subject, why, variable, value = refused
        if self.event_writer.takes_inputs:
            about = {"variable": variable, "value": value} if variable else {}
            self.event_writer.write_input(agent, "refused", subject=subject, message=why, **about)
        self.event_writer.write(Kind.KNOWLEDGE, subject, "refused", agent=agent, message=why)
        if variable:
            self.event_writer.write(Kind.VARIABLE, variable, "refused", value=value, source=agent)

    def write_rule(self, agent: str, rule: str, became: str, message: str) -> None:
        """Tell what became of a rule of an agent."""
        about = {"rule": rule, "message": message or None}
        self.event_writer.write_input(agent, "rule", became=became, **about)
        self.event_writer.write(Kind.KNOWLEDGE, f"{agent}.{rule}", became, agent=agent, **about)

    def refused(self, operation: Operation, why: str, nodes: Mapping[str, str]) -> Refused:
        """Return what is told of an operation that was refused.

        Args:
            operation: what was refused.
            why: what the error says.
            nodes: by context-variable.
        """
        if operation.verb is not Verb.SET:
            return Refused(operation.subject, why)
        node, name, given, _ = operation.given
        variable = next((each for each in self.variables if each.name == name and nodes[name] == node), None)
        if variable is None:
            return Refused(operation.subject, why)
        try:
            content = None if given is None else variable.type.convert(given)
        except NotOfTypeError:
            content = None
        return Refused(operation.subject, why, name, content)
