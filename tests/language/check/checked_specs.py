"""Checked specs built by hand, for tests of the stages after the checks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from codra_dsl.language.check.checked.spec import CheckedAlgorithm, CheckedCondition, CheckedSpec
from codra_dsl.language.diagnostics import Place, Span
from codra_dsl.language.model import (
    Algorithm,
    Condition,
    Expectation,
    Expected,
    Identification,
    Kind,
    Literal,
    ObserverSetting,
    Reference,
    Resource,
    Returned,
    Skill,
    Spec,
    Usage,
    Use,
    ValueType,
    Variable,
)

FILE = "specs/lab.yaml"


def place(line: int = 1, file: str = FILE) -> Place:
    return Place(Span(file, line, 1, line, 2))


def reference(name: str) -> Reference:
    return Reference(name=name, place=place())


def condition(text: str, *variables: str, python: str | None = None) -> CheckedCondition:
    python_text = python if python is not None else f"value({text!r})"
    return CheckedCondition(text=text, python=python_text, variables=variables or (text,), place=place())


def variable(name: str, **fields: object) -> Variable:
    known = {"name": name, "type": ValueType(kind=Kind.BOOL), "place": place(), "label": name} | fields
    return Variable(**({"sources": (reference("observer"),)} | known))  # type: ignore[arg-type]


@dataclass(frozen=True, kw_only=True)
class ShortAlgorithm:
    """A perception algorithm in short form: its needs and its variables.

    Attributes:
        identifies: variables, or pairs of a variable and its condition as Python text.
        feedback: the names in `needs` that it does not wait for.
    """

    name: str
    identifies: Sequence[str | tuple[str, str]]
    needs: Sequence[str | CheckedCondition] = ()
    given: Sequence[str] = ()
    accept: Sequence[CheckedCondition] = ()
    feedback: Sequence[str] = ()
    rank: int = 1
    call: str = "robot.perception:look"
    parameters: Mapping[str, Literal] | None = None
    uses: Sequence[Usage] = ()
    returns: Sequence[Returned] = ()
    timeout_s: float = 5.0
    place: Place = field(default_factory=place)

    def checked(self) -> CheckedAlgorithm:
        needs = tuple(need if isinstance(need, CheckedCondition) else condition(need) for need in self.needs)
        pairs = [(entry, "value('seen')") if isinstance(entry, str) else entry for entry in self.identifies]
        read = {name for need in needs for name in need.variables} | set(self.given)
        algorithm = Algorithm(
            name=self.name,
            place=self.place,
            call=self.call,
            parameters=tuple((self.parameters or {}).items()),
            uses=tuple(self.uses),
            given=tuple(map(reference, self.given)),
            returns=tuple(self.returns),
            identifies=tuple(
                Identification(variable=reference(name), by=Condition(text=text, tree=None, place=place()))
                for name, text in pairs
            ),
            timeout_s=self.timeout_s,
            rank=self.rank,
        )
        return CheckedAlgorithm(
            algorithm=algorithm,
            observable_when=needs,
            accept_when=tuple(self.accept),
            identifies=tuple((name, condition(text, "seen", python=text)) for name, text in pairs),
            waits_for=tuple(sorted(read - set(self.feedback))),
            feedback=tuple(sorted(self.feedback)),
        )


def skill(name: str, preview: Sequence[str], monitor: Sequence[str] = ()) -> Skill:
    expectations = (
        Expectation(variable=reference(variable_name), expected=Expected.WATCHED, place=place())
        for variable_name in monitor
    )
    return Skill(name=name, place=place(), preview=tuple(map(reference, preview)), monitor=tuple(expectations))


def setting(name: str, *variables: str, period_s: float = 1.0, priority: int = 0) -> ObserverSetting:
    identifies = tuple(map(reference, variables))
    return ObserverSetting(name=name, place=place(), identifies=identifies, period_s=period_s, priority=priority)


def checked_spec(
    algorithms: Iterable[ShortAlgorithm],
    *,
    name: str = "lab",
    skills: Sequence[Skill] = (),
    observers: Sequence[ObserverSetting] = (),
    variables: Iterable[Variable] = (),
    resources: Sequence[Resource] = (),
    uses: Sequence[Use] = (),
    origins: Mapping[tuple[str, str], str] | None = None,
) -> CheckedSpec:
    """Return the checked spec that load and check would return for these elements.

    Undeclared variables are bools: with `observer` as source if an algorithm identifies them, else with the main
    execution as source.
    """
    checked_algorithms = {algorithm.name: algorithm.checked() for algorithm in algorithms}
    declared_variables = _variables(checked_algorithms, variables, skills)
    producer_names: dict[str, list[str]] = {}
    for algorithm_name, algorithm in checked_algorithms.items():
        for variable_name, _ in algorithm.identifies:
            producer_names.setdefault(variable_name, []).append(algorithm_name)
    producers = {
        declared_name: tuple(
            sorted(
                producer_names[declared_name],
                key=lambda algorithm_name: (checked_algorithms[algorithm_name].algorithm.rank, algorithm_name),
            )
        )
        for declared_name in declared_variables
        if declared_name in producer_names
    }
    decision_names = [
        watched.name for one in skills for watched in (*one.preview, *(seen.variable for seen in one.monitor))
    ]
    homes = {("context", variable_name): "lab" for variable_name in declared_variables}
    homes |= {("perception", algorithm_name): "lab" for algorithm_name in checked_algorithms}
    homes |= {("skills", one.name): "lab" for one in skills}
    spec = Spec(
        name=name,
        place=place(),
        file=FILE,
        files=(FILE,),
        context=tuple(declared_variables.values()),
        perception=tuple(checked.algorithm for checked in checked_algorithms.values()),
        skills=tuple(skills),
        observers=tuple(observers),
        resources=tuple(resources),
        uses=tuple(uses),
        origins=homes | dict(origins or {}),
    )
    decisions = tuple(dict.fromkeys(decision_names if skills else producers))
    return CheckedSpec(
        spec=spec, variables=declared_variables, algorithms=checked_algorithms, producers=producers, decisions=decisions
    )


def _variables(
    algorithms: Mapping[str, CheckedAlgorithm], variables: Iterable[Variable], skills: Sequence[Skill]
) -> dict[str, Variable]:
    variables_by_name = {variable_.name: variable_ for variable_ in variables}
    for algorithm in algorithms.values():
        for name, _ in algorithm.identifies:
            variables_by_name.setdefault(name, variable(name))
    needed_names = [name for algorithm in algorithms.values() for name in algorithm.needs]
    needed_names += [
        watched.name for one in skills for watched in (*one.preview, *(seen.variable for seen in one.monitor))
    ]
    for name in needed_names:
        variables_by_name.setdefault(name, variable(name, sources=(reference("main_execution"),)))
    return variables_by_name
