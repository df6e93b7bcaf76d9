"""The link of a graph to its context manager: shared variables, steps, and the journal."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from codra_dsl.logic import Value
from codra_dsl.runtime.journal import EventWriter, Kind
from codra_dsl.runtime.knowledge.change_set import ChangeSet
from codra_dsl.runtime.knowledge.operations import Operation, Verb, operations_text
from codra_dsl.runtime.locked_clock import LockedClock
from codra_dsl.runtime.values.cell import Reading
from codra_dsl.runtime.values.model import NotOfTypeError, VariableModel


class RefusedWrite(NamedTuple):
    """A refused write, as a journal records it.

    Attributes:
        subject: the subject of the write.
        message: the message of the error.
        variable: the context-variable, if the subject is one; otherwise empty.
        value: the new value of the variable; None if it does not have the variable's type.
    """

    subject: str
    message: str
    variable: str = ""
    value: Value | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ContextLink:
    """The interface of a context manager for its graph.

    Each context-variable is an attribute of a node; graph and context hold the same reading objects. In one step, first
    the graph's map changes and then the variable's cell. Each write to the graph or to the context holds the single
    lock of the steps. So no thread ever needs two locks, and no order of locks has to be observed.

    Attributes:
        variables: the variables of the context.
        clock: turns each write into a step, and each deadline into an event.
        event_writer: writes the journal.
        write_all: writes readings of variables to the context together, which passes each of them on to `mirror`.
    """

    variables: Sequence[VariableModel]
    clock: LockedClock
    event_writer: EventWriter
    write_all: Callable[[Sequence[Reading[Value]]], None]

    def write_input(self, agent: str, operations: Sequence[Operation]) -> None:
        """Record an agent's operations in the journal, before their effects become visible."""
        if operations and self.event_writer.accepts_inputs:
            self.event_writer.write_input(agent, "graph", operations=operations_text(operations))

    def commit(self, change_set: ChangeSet, version: int) -> None:
        """Write the readings of context-variables to the context, and record all other changes in the journal."""
        self.write_all(change_set.context_readings)
        for name, what, details in change_set.records or ():
            self.event_writer.write(Kind.KNOWLEDGE, name, what, version=version, **details)

    def record_refusal(self, agent: str, refused_write: RefusedWrite) -> None:
        """Record a refused write. If its subject is a context-variable, record it as an event of this variable as well.

        The refusal is an input: a replay reads the refusal from the journal and does not derive it again.
        """
        subject, message, variable, value = refused_write
        if self.event_writer.accepts_inputs:
            details = {"variable": variable, "value": value} if variable else {}
            self.event_writer.write_input(agent, "refused", subject=subject, message=message, **details)
        self.event_writer.write(Kind.KNOWLEDGE, subject, "refused", agent=agent, message=message)
        if variable:
            self.event_writer.write(Kind.VARIABLE, variable, "refused", value=value, source=agent)

    def record_rule_state(self, agent: str, rule: str, state: str, message: str) -> None:
        """Record the new state of an agent's rule."""
        details = {"rule": rule, "message": message or None}
        self.event_writer.write_input(agent, "rule", became=state, **details)
        self.event_writer.write(Kind.KNOWLEDGE, f"{agent}.{rule}", state, agent=agent, **details)

    def make_refused_write(
        self, operation: Operation, message: str, nodes_by_variable: Mapping[str, str]
    ) -> RefusedWrite:
        """Return the record of a refused operation.

        Args:
            operation: the refused operation.
            message: the message of the error.
            nodes_by_variable: for each context-variable, the name of the node that has it as an attribute.
        """
        if operation.verb is not Verb.SET:
            return RefusedWrite(operation.subject, message)
        node, name, value, _ = operation.arguments
        variable = next(
            (candidate for candidate in self.variables if candidate.name == name and nodes_by_variable[name] == node),
            None,
        )
        if variable is None:
            return RefusedWrite(operation.subject, message)
        try:
            converted_value = None if value is None else variable.type.convert(value)
        except NotOfTypeError:
            converted_value = None
        return RefusedWrite(operation.subject, message, name, converted_value)
