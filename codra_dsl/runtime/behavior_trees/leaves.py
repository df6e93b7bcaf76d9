"""Nodes without children: the built-in ones, and the robot's actions and conditions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, Protocol

from codra_dsl.runtime.behavior_trees.node import Assignment, Entry, Kind, Node, Script, Setting, TickContext
from codra_dsl.runtime.behavior_trees.result import Result, TreeError
from codra_dsl.runtime.behavior_trees.scope import Scope, is_true, number_in

_S_PER_MS = 0.001


def always_success() -> Kind:
    """Succeed."""
    return _ImmediateLeaf(lambda _: True)


def always_failure() -> Kind:
    """Fail."""
    return _ImmediateLeaf(lambda _: False)


def script_condition(condition: Script) -> Kind:
    """Succeed if a condition holds, otherwise fail."""
    return _ImmediateLeaf(lambda node: is_true(condition(node.scope)))


def unset_blackboard(key: str) -> Kind:
    """Remove an entry."""

    def unset(node: Node) -> bool:
        node.scope.unset(key)
        return True

    return _ImmediateLeaf(unset)


def set_blackboard(value: Setting, output_key: str) -> Kind:
    """Write a text, or the value of another entry, into an entry; fail if the other entry has no value yet."""
    return _SetBlackboard(value, output_key)


def script(*statements: Assignment) -> Kind:
    """Write entries."""

    def run(node: Node) -> bool:
        for statement in statements:
            statement.run(node.scope)
        return True

    return _ImmediateLeaf(run)


class _ImmediateLeaf(Kind):
    """A leaf that completes within the tick in which it begins."""

    def __init__(self, succeeds: Callable[[Node], bool]) -> None:
        self._succeeds = succeeds

    def tick(self, node: Node) -> Result:
        """Succeed or fail."""
        return Result.SUCCESS if self._succeeds(node) else Result.FAILURE


class _SetBlackboard(Kind):
    """Writes an entry."""

    def __init__(self, value: Setting, output_key: str) -> None:
        self._value = value
        self._output_key = output_key

    def tick(self, node: Node) -> Result:
        """Write the entry, or fail if the value is an entry that ports declare and that has no value yet."""
        if isinstance(self._value, Entry) and node.scope.is_empty(self._value.key):
            return Result.FAILURE
        node.scope.create(self._output_key, node.read(self._value))
        return Result.SUCCESS


class WasEntryUpdated(Kind):
    """Succeeds if an entry was written since the last check, otherwise fails."""

    def __init__(self, entry: str) -> None:
        self._entry = entry
        self._seen_write_count = 0

    def tick(self, node: Node) -> Result:
        """Check the entry."""
        previous_write_count, self._seen_write_count = self._seen_write_count, node.scope.write_count(self._entry)
        return Result.FAILURE if self._seen_write_count == previous_write_count else Result.SUCCESS


class Sleep(Kind):
    """Runs for a given time, then succeeds."""

    def __init__(self, msec: Setting) -> None:
        self._msec = msec
        self._due_s: float | None = None

    def tick(self, node: Node) -> Result:
        """Wait."""
        if self._due_s is None:
            self._due_s = node.now_s + node.read_integer(self._msec) * _S_PER_MS
        if node.now_s < self._due_s:
            node.tick_context.pulse.wait_for(self._due_s)
            return Result.RUNNING
        self._due_s = None
        return Result.SUCCESS

    def halt(self, node: Node) -> None:  # noqa: ARG002
        """Begin a new wait when the node next starts."""
        self._due_s = None


# The robot's actions and conditions


class Ports:
    """The input and output ports of a robot's leaf."""

    def __init__(self, name: str, scope: Scope, inputs: Mapping[str, Setting], outputs: Mapping[str, Entry]) -> None:
        self._name = name
        self._scope = scope
        self._inputs = inputs
        self._outputs = outputs

    def __contains__(self, port: str) -> bool:
        return port in self._inputs

    def value(self, port: str) -> Any:
        """Return the value of an input: the text of the input, or the value of the input's entry.

        Raises:
            TreeError: if the input is not set, or its entry does not exist.
        """
        if port not in self._inputs:
            raise TreeError(f"{self._name!r} has no input {port!r}: its inputs are {_names_text(self._inputs)}")
        setting = self._inputs[port]
        return self._scope.get(setting.key) if isinstance(setting, Entry) else setting

    def text(self, port: str) -> str:
        """Return an input as text."""
        return str(self.value(port))

    def number(self, port: str) -> float:
        """Return an input as a number.

        Raises:
            TreeError: if the input is neither a number nor the text of a number.
        """
        number = number_in(self.value(port))
        if number is None:
            raise TreeError(f"the port {port!r} of {self._name!r} needs a number, not {self.value(port)!r}")
        return float(number)

    def truth(self, port: str) -> bool:
        """Return an input as a boolean."""
        return is_true(self.value(port))

    def set(self, port: str, value: object) -> None:
        """Write an output; the value is dropped if the output has no entry.

        Raises:
            TreeError: if the output's entry has a value of another type.
        """
        if port in self._outputs:
            self._scope.create(self._outputs[port].key, value)


def _names_text(names: Iterable[str]) -> str:
    return ", ".join(sorted(names)) or "none"


class Action(Protocol):
    """One activity of a robot, for one leaf of a tree."""

    def start(self, ports: Ports) -> Result:
        """Begin; return RUNNING, or the result if it completes at once."""
        ...

    def go_on(self, ports: Ports) -> Result:
        """Return RUNNING, or the result."""
        ...

    def halt(self, ports: Ports) -> None:
        """Stop the running activity."""
        ...


class Robot:
    """The actions, conditions, control nodes and decorators of a robot, by their names in trees."""

    def __init__(self) -> None:
        self._action_factories: dict[str, Callable[[], Action]] = {}
        self._control_factories: dict[str, Callable[[Ports], Kind]] = {}

    def can(self, name: str, make: Callable[[], Action]) -> None:
        """Register a factory of an action, which is called once per leaf.

        Raises:
            ValueError: if the name is already registered.
        """
        if name in self._action_factories:
            raise ValueError(f"the action {name!r} already exists")
        self._action_factories[name] = make

    def does(self, name: str, function: Callable[[Ports], bool | Result]) -> None:
        """Register a function as a condition or action; a function that has returned RUNNING is called again."""
        self.can(name, lambda: _FunctionAction(name, function))

    def controls(self, name: str, make: Callable[[Ports], Kind]) -> None:
        """Register a control node or a decorator.

        Args:
            name: the name of the node in trees.
            make: returns the kind of one node, given the node's ports; usually a subclass of `Kind`. It is called once
                per node.

        Raises:
            ValueError: if the name is already registered.
        """
        if name in self._control_factories:
            raise ValueError(f"the control node {name!r} already exists")
        self._control_factories[name] = make

    def control(self, name: str, ports: Ports) -> Kind:
        """Return the kind of a control node or a decorator.

        Raises:
            TreeError: if the robot has no control node of this name.
        """
        if name not in self._control_factories:
            names_text = _names_text(self._control_factories)
            raise TreeError(f"the robot has no control node {name!r}: it has {names_text}; add it with Robot.controls")
        return self._control_factories[name](ports)

    def of(self, name: str) -> Action:
        """Return an action for a leaf.

        Raises:
            TreeError: if the robot has no action of this name.
        """
        if name not in self._action_factories:
            raise TreeError(f"the robot has no action {name!r}: it has {_names_text(self._action_factories)}")
        return self._action_factories[name]()


class _FunctionAction(Action):
    """A function as an action."""

    def __init__(self, name: str, function: Callable[[Ports], bool | Result]) -> None:
        self._name = name
        self._function = function

    def start(self, ports: Ports) -> Result:
        """Call the function."""
        result = self._function(ports)
        if isinstance(result, Result):
            return result
        if not isinstance(result, bool):
            raise TreeError(f"{self._name!r} returned {result!r}: it must return True, False or a Result")
        return Result.SUCCESS if result else Result.FAILURE

    def go_on(self, ports: Ports) -> Result:
        """Call the function again after it has returned RUNNING."""
        return self.start(ports)

    def halt(self, ports: Ports) -> None:
        """Do nothing, because the function does not run between calls."""


class _RobotNode(Kind):
    """A node of the robot, with its ports."""

    def __init__(
        self, name: str, *, inputs: Mapping[str, Setting] | None = None, outputs: Mapping[str, Entry] | None = None
    ) -> None:
        self._name = name
        self._inputs = inputs or {}
        self._outputs = outputs or {}

    def entries(self) -> Iterable[Entry]:
        """Return the entries of the node's ports."""
        return (setting for setting in (*self._inputs.values(), *self._outputs.values()) if isinstance(setting, Entry))

    def _ports(self, scope: Scope) -> Ports:
        return Ports(self._name, scope, self._inputs, self._outputs)

    def _not_idle(self, result: Result) -> Result:
        if result is Result.IDLE:
            raise TreeError(f"{self._name!r} returned IDLE: it must return RUNNING, SUCCESS, FAILURE or SKIPPED")
        return result

    def _unbound_error(self) -> TreeError:
        return TreeError(f"the node {self._name!r} is not bound: tick it as part of a Tree")


class Leaf(_RobotNode):
    """An action or a condition of the robot."""

    _binding: tuple[Action, Ports] | None = None

    def bind(self, node: Node, tick_context: TickContext) -> TickContext:  # noqa: ARG002
        """Create the action and its ports."""
        self._binding = tick_context.leaves.of(self._name), self._ports(tick_context.scope)
        return tick_context

    def tick(self, node: Node) -> Result:
        """Start the action, or continue it."""
        action, ports = self._action_and_ports()
        return self._not_idle(action.go_on(ports) if node.is_running else action.start(ports))

    def halt(self, node: Node) -> None:  # noqa: ARG002
        """Stop the action."""
        action, ports = self._action_and_ports()
        action.halt(ports)

    def _action_and_ports(self) -> tuple[Action, Ports]:
        if self._binding is None:
            raise self._unbound_error()
        return self._binding


class Control(_RobotNode):
    """A control node or a decorator of the robot; its kind is registered with `Robot.controls`."""

    _kind: Kind | None = None

    def bind(self, node: Node, tick_context: TickContext) -> TickContext:
        """Create the registered kind and bind it."""
        self._kind = tick_context.leaves.control(self._name, self._ports(tick_context.scope))
        return self._kind.bind(node, tick_context)

    def tick(self, node: Node) -> Result:
        """Tick the registered kind."""
        return self._not_idle(self._registered_kind().tick(node))

    def halt(self, node: Node) -> None:
        """Clear the state of the registered kind."""
        self._registered_kind().halt(node)

    def _registered_kind(self) -> Kind:
        if self._kind is None:
            raise self._unbound_error()
        return self._kind
