"""Algorithm 1 of P1, runtime control of observers, with the stopping half that the paper leaves open.

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

What runs is the least set that holds the observers of C_E and, with each observer, those of the variables that it
needs. Counts over the strongly connected components of that relation keep it: a component runs while something
declared lies in it or a running component needs it. So starting and stopping cost what changes, feedback included.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence


class Activation:
    """Which observers run, given what is declared."""

    def __init__(
        self,
        identifies: Mapping[str, Sequence[str]],
        needs: Mapping[str, Sequence[str]],
        start: Callable[[str], None],
        stop: Callable[[str], None],
    ) -> None:
        """Relate observers.

        Args:
            identifies: the variables that each observer identifies; each variable belongs to one observer at most.
            needs: C_Oi, the variables that each observer needs (P1, Equation 7).
            start: called for each observer that starts, the ones that need others first, as in the paper.
            stop: called for each observer that stops.
        """
        self._observer_of = {variable: name for name, variables in identifies.items() for variable in variables}
        successors = {
            name: sorted({self._observer_of[need] for need in needs[name] if need in self._observer_of})
            for name in sorted(identifies)
        }
        self._components = strongly_connected(successors)
        self._component_of = {name: index for index, members in enumerate(self._components) for name in members}
        self._needed = [self._successors(index, successors) for index in range(len(self._components))]
        self._levels: list[int] = []
        for needed in self._needed:
            self._levels.append(1 + max((self._levels[index] for index in needed), default=0))
        self._counts = [0] * len(self._components)
        self._start = start
        self._stop = stop

    @property
    def order(self) -> tuple[str, ...]:
        """Return all observers, each after those that it needs, then by name.

        One more observer that nobody needs changes nothing in the order of the others.
        """
        return tuple(sorted(self._component_of, key=lambda name: (self._levels[self._component_of[name]], name)))

    def running(self) -> frozenset[str]:
        """Return the observers that run."""
        return frozenset(
            name for count, members in zip(self._counts, self._components, strict=True) if count for name in members
        )

    def declare(self, variable: str) -> None:
        """Take a variable into C_E(t); it must not be in it yet."""
        observer = self._observer_of.get(variable)
        if observer is not None:
            self._change(self._component_of[observer], 1, self._start)

    def withdraw(self, variable: str) -> None:
        """Take a variable out of C_E(t); it must be in it."""
        observer = self._observer_of.get(variable)
        if observer is not None:
            self._change(self._component_of[observer], -1, self._stop)

    def _change(self, component: int, step: int, act: Callable[[str], None]) -> None:
        pending = [component]
        while pending:
            index = pending.pop()
            before = self._counts[index]
            self._counts[index] += step
            if (before == 0) != (self._counts[index] == 0):
                for name in self._components[index]:
                    act(name)
                pending.extend(reversed(self._needed[index]))

    def _successors(self, index: int, successors: Mapping[str, Sequence[str]]) -> list[int]:
        found = {self._component_of[other] for name in self._components[index] for other in successors[name]}
        return sorted(found - {index})


def strongly_connected(successors: Mapping[str, Sequence[str]]) -> list[list[str]]:
    """Return the strongly connected components of a graph, each after its successors, members sorted (Tarjan).

    It does not recurse, so chains may be of any length.
    """
    numbers: dict[str, int] = {}
    lows: dict[str, int] = {}
    stack: list[str] = []
    on_stack: set[str] = set()
    components: list[list[str]] = []
    for root in successors:
        if root in numbers:
            continue
        path = [(root, iter(successors[root]))]
        _enter(root, numbers, lows, stack, on_stack)
        while path:
            name, remaining = path[-1]
            shared = next(remaining, None)
            if shared is None:
                path.pop()
                if path:
                    lows[path[-1][0]] = min(lows[path[-1][0]], lows[name])
                if lows[name] == numbers[name]:
                    components.append(_leave(name, stack, on_stack))
            elif shared not in numbers:
                _enter(shared, numbers, lows, stack, on_stack)
                path.append((shared, iter(successors[shared])))
            elif shared in on_stack:
                lows[name] = min(lows[name], numbers[shared])
    return components


def _enter(name: str, numbers: dict[str, int], lows: dict[str, int], stack: list[str], on_stack: set[str]) -> None:
    numbers[name] = lows[name] = len(numbers)
    stack.append(name)
    on_stack.add(name)


def _leave(name: str, stack: list[str], on_stack: set[str]) -> list[str]:
    component: list[str] = []
    while not component or component[-1] != name:
        component.append(stack.pop())
        on_stack.discard(component[-1])
    return sorted(component)
