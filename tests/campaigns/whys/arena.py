"""Random specs, and random runs of them, reproducible by their seed."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from pathlib import Path
from random import Random
from types import ModuleType
from typing import Any

from codra_dsl.compiler import plan_paths
from codra_dsl.generation.emit import emit
from codra_dsl.integrations.inspection.loading import load_package
from codra_dsl.runtime import ContextManager, Journal, NotASourceError, NotDeclaredError, SimClock
from codra_dsl.runtime.context.model import ContextModel
from codra_dsl.runtime.values.model import Algorithm, ValueType
from generated import kitchen, lab

EPOCH_S = 2.0
"""How long the results of perception stay the same."""

PAUSE_S = 0.35
RANDOM_SPECS = 12
_NUMBERS = (-0.2, 0.0, 0.2, 0.55, 0.8, 1.0, 1.3, 3.0, 9.0, 40.0, 70.0, 700.0)


def package(number: int, folder: Path) -> ModuleType:
    """Return the laboratory, the kitchen, or one of the specs by chance, compiled."""
    number %= RANDOM_SPECS + 4
    if number < 4:
        return (lab, kitchen)[number % 2]
    made = folder / f"spec_{number}"
    if not made.exists():
        (made / "specs").mkdir(parents=True)
        (made / "specs/chance.yaml").write_text(spec_text(number))
        planned = plan_paths([made / "specs"], made)
        assert planned.plans, [str(diagnostic) for diagnostic in planned.diagnostics]
        for path, text in emit(planned.plans[0]).items():
            (made / path).parent.mkdir(parents=True, exist_ok=True)
            (made / path).write_text(text)
    return load_package(made / "chance")


_TYPES = {
    "bool": "type: bool",
    "int": "type: int, range: [0, 12]",
    "float": "type: float, unit: m, range: [-5, 50]",
    "enum": "type: enum, values: [idle, busy, done]",
}
_RETURNS = {**_TYPES, "float": "type: float, unit: m"}
_FORMS = {
    "bool": ("{0}", "not {0}", "known({0})", "{0} and age({0}) < 3 s"),
    "int": ("{0} >= 3", "{0} > 1 and {0} < 3", "{0} + 2 == 9", "{0} in (2, 5, 7)", "{0} - 1 > 3 or {0} == 0"),
    "float": ("abs({0}) < 50 cm", "{0} * 2 > 70 m", "{0} > 10 cm and {0} <= 30 cm", "min({0}, 4 m) > 1 m"),
    "enum": ('{0} == "done"', '{0} in ("idle", "busy")', '{0} != "idle"', "known({0})"),
}


def spec_text(seed: int) -> str:
    """Return a spec with four written and eight observed variables, under conditions of many forms."""
    chance = Random(f"spec {seed}")
    kinds = {f"v{number}": chance.choice(sorted(_TYPES)) for number in range(12)}
    lines = ["codra: 1", "name: chance", "agents:", "  house: {}", "context:"]
    lines += [f"  {name}: {{{_declared(name, kind, chance)}}}" for name, kind in kinds.items()]
    lines.append("resources:\n  vision: {slots: 1}\nperception:")
    for number in range(4, 12):
        for rank in range(1, chance.choice([2, 2, 3])):
            lines += _algorithm(f"v{number}", rank, list(kinds)[:number], kinds, chance)
    lines.append("skills:")
    for number in range(3):
        preview = ", ".join(chance.sample(list(kinds)[4:], 3))
        lines.append(f"  s{number}: {{preview: [{preview}], changes: [v{chance.randrange(4, 12)}]}}")
    lines.append(f"  all: {{preview: [{', '.join(list(kinds)[4:])}]}}")
    return "\n".join(lines) + "\n"


def _declared(name: str, kind: str, chance: Random) -> str:
    if int(name[1:]) < 4:
        source = chance.choice(["main_execution", "house", "[main_execution, house]"])
        return f"{_TYPES[kind]}, source: {source}, valid_for: {chance.choice(['2 s', '1 min'])}"
    keeps = f"valid_for: {chance.choice(['1 s', '4 s', '1 min'])}"
    return f"{_TYPES[kind]}, {keeps}{chance.choice(['', ', when_unobservable: forget'])}"


def _algorithm(name: str, rank: int, earlier: list[str], kinds: Mapping[str, str], chance: Random) -> list[str]:
    conditions = []
    for needed in chance.sample(earlier, chance.choice([1, 1, 2, 3])):
        condition = chance.choice(_FORMS[kinds[needed]]).format(needed)
        other = chance.choice(earlier)
        alternative = chance.choice(_FORMS[kinds[other]]).format(other)
        conditions.append(chance.choice([condition, condition, condition, f"({condition}) or ({alternative})"]))
    return [
        f"  look_{name}_{rank}:",
        "    call: tests.campaigns.whys.arena:nothing",
        f"    rank: {rank}",
        f"    timeout: {chance.choice(['500 ms', '5 s'])}",
        *(["    uses: {vision: slot}"] if chance.random() < 0.3 else []),
        f"    returns: {{seen: {{{_RETURNS[kinds[name]]}, optional: true}}}}",
        "    observable_when:",
        *(f"      - '{condition}'" for condition in dict.fromkeys(conditions)),
        f"    identifies: {{{name}: seen}}",
    ]


class Run:
    """A run of a package in simulated time.

    Attributes:
        still_since_s: the instant from which the results of perception no longer change.
    """

    def __init__(self, module: ModuleType, seed: int, journal: Path | None) -> None:
        self.clock, self.seed, self.still_since_s = SimClock(), seed, float("inf")
        self.model: ContextModel = module.MODEL
        classes = [
            member
            for member in vars(module).values()
            if isinstance(member, type) and issubclass(member, ContextManager)
        ]
        self.manager: ContextManager[Any, Any] = next(
            manager_class for manager_class in classes if manager_class is not ContextManager
        )(
            self.model,
            clock=self.clock,
            resources={resource.name: object() for resource in self.model.resources if resource.slots is None},
            seed=seed,
            record=None if journal is None else Journal(journal),
            find=self.find,
        )

    def find(self, algorithm: Algorithm) -> Callable[..., object]:
        """Return a simulated perception function, whose results depend on the seed, the algorithm and the time."""

        def look(*, job: Any, **_: object) -> object:
            epoch = int(min(job.now_s(), self.still_since_s) / EPOCH_S)
            chance = Random(f"{self.seed} {algorithm.name} {epoch}")
            job.evidence(job.now_s(), job.now_s())
            job.sleep(chance.choice([0.05, 0.2, 0.6]))
            if chance.random() < 0.05:
                raise ValueError("no picture")
            return {name: random_value(kind, chance) for name, kind in algorithm.returns.items()}

        return look


def random_value(value_type: ValueType, chance: Random) -> object:
    """Return a random value of a type, or sometimes None if the type is optional."""
    if value_type.optional and chance.random() < 0.1:
        return None
    if value_type.kind in ("int", "float"):
        low, high = value_type.range or (-float("inf"), float("inf"))
        fit = [
            number
            for number in _NUMBERS
            if low <= number <= high and (value_type.kind == "float" or float(number).is_integer())
        ]
        return int(chance.choice(fit)) if value_type.kind == "int" else chance.choice(fit)
    return chance.choice(value_type.members or (True, False))


def run_until(module: ModuleType, seed: int, end_s: float, journal: Path | None) -> Run:
    """Run a spec up to an instant; its program declares, expects, writes and acts at random."""
    run, chance = Run(module, seed, journal), Random(f"program {seed}")
    while run.clock.now_s() < end_s:
        with contextlib.suppress(NotDeclaredError, NotASourceError):
            _do_something(run, chance)
        run.clock.sleep(min(PAUSE_S, end_s - run.clock.now_s()))
    return run


def _do_something(run: Run, chance: Random) -> None:
    variable, skill = chance.choice(run.model.variables), chance.choice(run.model.skills)
    luck = chance.random()
    if luck < 0.25:
        run.manager.declare(variable.name)
    elif luck < 0.35:
        run.manager.withdraw(variable.name)
    elif luck < 0.45:
        run.manager.expect(skill.name)
    elif luck < 0.5:
        with run.manager.skill(skill.name) as begun, begun.acting():
            run.clock.sleep(0.0)
    else:
        written_variable = chance.choice(
            [candidate for candidate in run.model.variables if "observer" not in candidate.sources]
        )
        write(run, written_variable.name, random_value(written_variable.type, chance))


def write(run: Run, name: str, value: object) -> None:
    """Write a variable as an agent that may write it, or else as the main execution, which declares it first."""
    sources = next(variable.sources for variable in run.model.variables if variable.name == name)
    agents = [source for source in sources if source not in ("main_execution", "observer")]
    if agents and "main_execution" not in sources:
        run.manager.agent(agents[0]).set(name, value)
    else:
        run.manager.declare(name, value)
