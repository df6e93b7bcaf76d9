"""The variables about which the journal of a what-if replay has too little information.

After its first difference, a replay may need a result that the run does not have: of a look at a time at which the run
did not look, or of the main execution's own look. No value is invented for it. The variables that such a result could
have changed are undetermined, and so are all variables whose observers depend on them, until evidence of the run
identifies them again.

If the package looks at other times than the run, the replay assumes that its looks happen when those of the run
happened. If an algorithm receives values of context-variables, the replay assumes that they are those of the run.
Variables that rest on such an assumption are called assumed. A look that finds no look of the run within the period of
its observer is missing, and its variables are undetermined.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager

from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.journal.spec_summary import SpecSummary
from codra_dsl.runtime.values.declarations import MAIN
from codra_dsl.runtime.values.hysteresis import DebouncedCondition, Hysteresis

NOT_RECORDED = "not recorded: the run did not look at this time, or did not need the result"
"""The message of a look whose result the run does not have."""


class Undetermined:
    """The undetermined and the assumed variables at the present instant of a replay.

    Attributes:
        missing_looks: the number of looks whose results the run does not have, by algorithm or `main_execution`.
        variables: the undetermined variables.
        assumed_variables: the variables whose readings rest on an assumption.
        periods_s: the period of each algorithm's observer, by algorithm.
    """

    def __init__(self, summary: SpecSummary) -> None:
        """Begin with readings that are all known to the replay."""
        self.missing_looks: Counter[str] = Counter()
        self.variables: set[str] = set()
        self.assumed_variables: set[str] = set()
        self._identified_variables = {name: set(algorithm.identifies) for name, algorithm in summary.algorithms.items()}
        derived_terms = ((name, variable.derived) for name, variable in summary.variables.items())
        self._inputs = {name: term.variables() for name, term in derived_terms if term is not None}
        self._read_variables = {
            name: {variable for rule in algorithm.preconditions for variable in rule.term.variables()}
            for name, algorithm in summary.algorithms.items()
        }
        self._readers: Mapping[str, set[str]] = defaultdict(set)
        for algorithm, read_variables in self._read_variables.items():
            for variable in read_variables:
                self._readers[variable] |= self._identified_variables[algorithm]
        for derived_variable, inputs in self._inputs.items():
            for variable in inputs:
                self._readers[variable].add(derived_variable)
        self._variables_with_memory = {
            variable
            for algorithm in summary.algorithms.values()
            for variable, rule in algorithm.identifies.items()
            if isinstance(rule.term, DebouncedCondition | Hysteresis)
        }
        self.periods_s = {
            algorithm: observer.period_s for observer in summary.observers.values() for algorithm in observer.algorithms
        }
        self._assumed_algorithms: set[str] = set()
        self._overdue_algorithms: set[str] = set()

    def begin_assumed_look(self, algorithm: str) -> None:
        """Handle the start of a look at a time at which the run began none, or with the values of variables."""
        self._assumed_algorithms.add(algorithm)
        self.assumed_variables |= self._with_dependents(self._identified_variables.get(algorithm, ()))

    def miss_look(self, algorithm: str) -> None:
        """Handle a look for which the run has no look within the period."""
        self._overdue_algorithms.add(algorithm)
        self.missing_looks[algorithm] += 1
        self.variables |= self._with_dependents(self._identified_variables.get(algorithm, ()))

    def end_look(self, algorithm: str, *, is_known: bool, is_assumed: bool) -> None:
        """Handle the end of a look: with a result of the run, or with a result that the run does not have."""
        if not is_known and algorithm not in self._overdue_algorithms:
            self.miss_look(algorithm)
        self._overdue_algorithms.discard(algorithm)
        if not is_assumed:
            self._assumed_algorithms.discard(algorithm)

    def miss_look_of_main_execution(self, variable: str) -> None:
        """Handle an own look of the main execution that the run did not make.

        Context does not keep what such a look finds for a derived variable.
        """
        self.missing_looks[MAIN] += 1
        if variable not in self._inputs:
            self.variables |= self._with_dependents([variable])

    @contextmanager
    def look_of_main_execution(self, variable: str, decided_variables: Iterable[str]) -> Iterator[None]:
        """Treat what happens in the `with` statement as a look that the main execution made in the run.

        If one of the decided variables is undetermined or assumed, the result of the look is so as well, because
        context might have decided without a look.
        """
        states = (self.variables, self.assumed_variables)
        doubtful_states = [state for state in states if not state.isdisjoint(decided_variables)]
        yield
        for state in doubtful_states if variable not in self._inputs else ():
            state.update(self._with_dependents([variable]))

    def add_event(self, event: Event) -> None:
        """Handle an event of the replay: evidence of the run may determine a variable again."""
        if not (self.variables or self.assumed_variables or self._assumed_algorithms):
            return  # nothing is doubtful, as before most first differences
        if event.kind is not Kind.VARIABLE or event.what != "identified" or not event.details.get("present"):
            return
        variable, source = event.name, event.details["source"]
        read_variables = self._inputs.get(variable) or self._read_variables.get(source, set())
        may_change = any(variable in self._identified_variables[algorithm] for algorithm in self._overdue_algorithms)
        has_memory = source in self._identified_variables and variable in self._variables_with_memory
        if not may_change and not has_memory and self.variables.isdisjoint(read_variables):
            self.variables.discard(variable)
        if source in self._assumed_algorithms or not self.assumed_variables.isdisjoint(read_variables):
            self.assumed_variables |= self._with_dependents([variable])
        elif not has_memory:
            self.assumed_variables.discard(variable)
        self._drop_derived(self.variables)
        self._drop_derived(self.assumed_variables)

    def _drop_derived(self, variables: set[str]) -> None:
        """Remove the derived variables without an input among some variables: they have no memory."""
        dropped = variables
        while dropped:
            dropped = {name for name in variables & self._inputs.keys() if variables.isdisjoint(self._inputs[name])}
            variables -= dropped

    def _with_dependents(self, variables: Iterable[str]) -> set[str]:
        """Return variables, and all variables whose observers depend on them, or that are derived from them."""
        dependents, new_variables = set[str](), set(variables)
        while new_variables:
            dependents |= new_variables
            new_variables = set[str]().union(*(self._readers[name] for name in new_variables)) - dependents
        return dependents
