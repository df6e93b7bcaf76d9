"""How urgently the main execution needs an observer, directly or through other observers that read its variables."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from enum import IntEnum

from codra_dsl.runtime.values.declarations import Declarations


class Urgency(IntEnum):
    """Why a variable is needed; a larger value is more urgent."""

    DECLARED = 0
    EXPECTED = 1
    UNDER_WAY = 2
    WAITED_FOR = 3


class Urgencies:
    """The most urgent need that each observer serves, directly or through observers that read its variables."""

    def __init__(
        self,
        identifies: Mapping[str, Sequence[str]],
        needs: Mapping[str, Sequence[str]],
        with_inputs: Callable[[Iterable[str]], Iterable[str]],
    ) -> None:
        """Build the relation between observers.

        Args:
            identifies: the variables of each observer.
            needs: the variables that each observer reads (P1, Equation 7).
            with_inputs: adds the inputs of the derived variables among some variables.
        """
        self._observer_by_variable = {
            variable: name for name, variables in identifies.items() for variable in variables
        }
        self._needs = needs
        self._with_inputs = with_inputs
        self._awaited_variables: dict[int, tuple[str, ...]] = {}
        self._urgency_by_observer: dict[str, Urgency] = {}
        self._wait_version = 0
        self._cached_version: tuple[int, int] | None = None

    def wait(self, number: int, *variables: str) -> None:
        """Note that a decision waits for variables."""
        self._awaited_variables[number] = variables
        self._wait_version += 1

    def answer(self, number: int) -> None:
        """Note that a decision no longer waits."""
        if self._awaited_variables.pop(number, None) is not None:
            self._wait_version += 1

    def version(self, declarations: Declarations) -> tuple[int, int]:
        """Return a value that changes when an urgency may have changed."""
        return declarations.version, self._wait_version

    def of(self, observer: str, declarations: Declarations) -> Urgency:
        """Return how urgent an observer is now."""
        version = self.version(declarations)
        if version != self._cached_version:
            self._cached_version, self._urgency_by_observer = version, {}
            for urgency, variables in self._needs_by_urgency(declarations):
                self._spread(urgency, variables)
        return self._urgency_by_observer.get(observer, Urgency.DECLARED)

    def _needs_by_urgency(self, declarations: Declarations) -> Iterator[tuple[Urgency, Iterable[str]]]:
        yield Urgency.WAITED_FOR, [name for names in self._awaited_variables.values() for name in names]
        yield Urgency.UNDER_WAY, declarations.names_of_active_skills()
        yield Urgency.EXPECTED, declarations.names_of_expected_skills()

    def _spread(self, urgency: Urgency, variables: Iterable[str]) -> None:
        """Give an urgency to the observers of some variables, and to all observers that these observers need.

        An observer that already has an urgency keeps it, because this method is called for the most urgent needs first.
        """
        pending_variables = sorted(self._with_inputs(variables))
        while pending_variables:
            observer = self._observer_by_variable.get(pending_variables.pop())
            if observer is not None and observer not in self._urgency_by_observer:
                self._urgency_by_observer[observer] = urgency
                pending_variables.extend(self._needs[observer])
