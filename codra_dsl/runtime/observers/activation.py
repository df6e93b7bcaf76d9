"""Algorithm 1 of P1, runtime control of observers. This module also stops observers; the paper leaves this open.

    1  procedure ActivateObservers(C_E, M)
    2    for all c in C_E:
    3      add c to C_M(t)
    4      StartObserver(O)                   the observer that identifies c
    7  procedure StartObserver(O, M)
    8    if running(O): return
    11   M.start(O)
    13   for all c' in C_O:                   what O needs
    14     if c' not in C_M(t):
    15       add c' to C_M(t)
    16       if an observer of c' exists: StartObserver of it

The running observers are the smallest set that contains the observers of C_E and, for each of its members, the
observers of the variables that this member needs. The set is maintained by counts over the strongly connected
components of this relation: a component runs while it has a declared variable or another running component needs it. So
the cost of starting and stopping depends only on what changes, even with feedback.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence


class Activation:
    """The observers that run for the present declarations."""

    def __init__(
        self,
        identifies: Mapping[str, Sequence[str]],
        needs: Mapping[str, Sequence[str]],
        start: Callable[[str], None],
        stop: Callable[[str], None],
    ) -> None:
        """Build the relation between observers.

        Args:
            identifies: the variables that each observer identifies; each variable belongs to at most one observer.
            needs: C_Oi, the variables that each observer needs (P1, Equation 7).
            start: called for each observer that starts. As in the paper, an observer is started before the observers
                that it needs.
            stop: called for each observer that stops.
        """
        self._observer_by_variable = {
            variable: name for name, variables in identifies.items() for variable in variables
        }
        successors = {
            name: sorted(
                {self._observer_by_variable[need] for need in needs[name] if need in self._observer_by_variable}
            )
            for name in sorted(identifies)
        }
        self._components = strongly_connected(successors)
        self._index_by_name = {name: index for index, members in enumerate(self._components) for name in members}
        self._needed_components = [self._successors(index, successors) for index in range(len(self._components))]
        self._levels: list[int] = []
        for needed_components in self._needed_components:
            self._levels.append(1 + max((self._levels[index] for index in needed_components), default=0))
        self._request_counts = [0] * len(self._components)
        self._start = start
        self._stop = stop

    @property
    def order(self) -> tuple[str, ...]:
        """Return all observers: each one after the observers that it needs, and otherwise in order of their names.

        An additional observer that no other observer needs does not change the order of the others.
        """
        return tuple(sorted(self._index_by_name, key=lambda name: (self._levels[self._index_by_name[name]], name)))

    def running(self) -> frozenset[str]:
        """Return the observers that run."""
        return frozenset(
            name
            for count, members in zip(self._request_counts, self._components, strict=True)
            if count
            for name in members
        )

    def declare(self, variable: str) -> None:
        """Add a variable to C_E(t), which must not contain the variable yet."""
        observer = self._observer_by_variable.get(variable)
        if observer is not None:
            self._change(self._index_by_name[observer], 1, self._start)

    def withdraw(self, variable: str) -> None:
        """Remove a variable from C_E(t), which must contain the variable."""
        observer = self._observer_by_variable.get(variable)
        if observer is not None:
            self._change(self._index_by_name[observer], -1, self._stop)

    def _change(self, component: int, step: int, act: Callable[[str], None]) -> None:
        pending_components = [component]
        while pending_components:
            index = pending_components.pop()
            before = self._request_counts[index]
            self._request_counts[index] += step
            if (before == 0) != (self._request_counts[index] == 0):
                for name in self._components[index]:
                    act(name)
                pending_components.extend(reversed(self._needed_components[index]))

    def _successors(self, index: int, successors: Mapping[str, Sequence[str]]) -> list[int]:
        successor_indices = {
            self._index_by_name[other] for name in self._components[index] for other in successors[name]
        }
        return sorted(successor_indices - {index})


def strongly_connected(successors: Mapping[str, Sequence[str]]) -> list[list[str]]:
    """Return the strongly connected components of a graph, by Tarjan's algorithm without recursion.

    Each component comes after its successors, and its members are sorted. Chains may have any length.
    """
    visit_numbers: dict[str, int] = {}
    low_numbers: dict[str, int] = {}
    stack: list[str] = []
    names_on_stack: set[str] = set()
    components: list[list[str]] = []
    for root in successors:
        if root in visit_numbers:
            continue
        path = [(root, iter(successors[root]))]
        _enter(root, visit_numbers, low_numbers, stack, names_on_stack)
        while path:
            name, remaining_successors = path[-1]
            successor = next(remaining_successors, None)
            if successor is None:
                path.pop()
                if path:
                    low_numbers[path[-1][0]] = min(low_numbers[path[-1][0]], low_numbers[name])
                if low_numbers[name] == visit_numbers[name]:
                    components.append(_leave(name, stack, names_on_stack))
            elif successor not in visit_numbers:
                _enter(successor, visit_numbers, low_numbers, stack, names_on_stack)
                path.append((successor, iter(successors[successor])))
            elif successor in names_on_stack:
                low_numbers[name] = min(low_numbers[name], visit_numbers[successor])
    return components


def _enter(
    name: str, visit_numbers: dict[str, int], low_numbers: dict[str, int], stack: list[str], names_on_stack: set[str]
) -> None:
    visit_numbers[name] = low_numbers[name] = len(visit_numbers)
    stack.append(name)
    names_on_stack.add(name)


def _leave(name: str, stack: list[str], names_on_stack: set[str]) -> list[str]:
    component: list[str] = []
    while not component or component[-1] != name:
        component.append(stack.pop())
        names_on_stack.discard(component[-1])
    return sorted(component)
