"""The variables whose readings a what-if replay cannot know.

After its first difference, a replay may need a result that the run does not have: of a look at a time at which the run
did not look, or of the main execution's own look. No value is invented for it. Instead, the variables that the result
could have changed are undetermined, and so are all variables whose observers depend on them, until evidence of the run
identifies them again.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping

from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.journal.spec_summary import SpecSummary
from codra_dsl.runtime.values.declarations import MAIN
from codra_dsl.runtime.values.hysteresis import DebouncedCondition, Hysteresis


class Undetermined:
    """The undetermined variables at the present instant of a replay.

    Attributes:
        missing_looks: the number of looks whose results the run does not have, by algorithm or `main_execution`.
    """

    def __init__(self, summary: SpecSummary) -> None:
        """Begin with readings that are all known to the replay."""
        self.missing_looks: Counter[str] = Counter()
        self._identified_variables = {name: set(algorithm.identifies) for name, algorithm in summary.algorithms.items()}
        self._read_variables: Mapping[str, set[str]] = {
            name: {variable for rule in algorithm.preconditions for variable in rule.term.variables()}
            for name, algorithm in summary.algorithms.items()
        }
        self._variables_with_memory = {
            variable
            for algorithm in summary.algorithms.values()
            for variable, rule in algorithm.identifies.items()
            if isinstance(rule.term, DebouncedCondition | Hysteresis)
        }
        self._open_looks: set[str] = set()
        self._variables: set[str] = set()

    def __contains__(self, variable: str) -> bool:
        return variable in self._variables

    def begin_look(self, algorithm: str) -> None:
        """Handle the start of a look at a time at which the run began none."""
        self._open_looks.add(algorithm)
        self._add(self._identified_variables.get(algorithm, ()))

    def end_look(self, algorithm: str, *, is_known: bool) -> None:
        """Handle the end of a look: with a result of the run, or with a result that the run does not have."""
        self._open_looks.discard(algorithm)
        if not is_known:
            self.missing_looks[algorithm] += 1
            self._add(self._identified_variables.get(algorithm, ()))

    def miss_look_of_main_execution(self, variable: str) -> None:
        """Handle an own look of the main execution that the run did not make."""
        self.missing_looks[MAIN] += 1
        self._add([variable])

    def add_event(self, event: Event) -> None:
        """Handle an event of the replay: evidence of the run may determine a variable again."""
        if event.kind is not Kind.VARIABLE or event.what != "identified" or not event.details.get("present"):
            return
        source = event.details["source"]
        is_from_look = source in self._identified_variables
        depends_on_more = is_from_look and (
            event.name in self._variables_with_memory or not self._variables.isdisjoint(self._read_variables[source])
        )
        may_change = any(event.name in self._identified_variables[algorithm] for algorithm in self._open_looks)
        if not depends_on_more and not may_change:
            self._variables.discard(event.name)

    def _add(self, variables: Iterable[str]) -> None:
        """Add variables, and all variables whose observers depend on them."""
        new_variables = set(variables) - self._variables
        while new_variables:
            self._variables |= new_variables
            new_variables = {
                identified_variable
                for algorithm, read_variables in self._read_variables.items()
                if not read_variables.isdisjoint(new_variables)
                for identified_variable in self._identified_variables[algorithm]
            } - self._variables
