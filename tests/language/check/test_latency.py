"""The worst case from declared to known, against generated observers in simulated time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from codra_dsl.compiler import compile_paths
from codra_dsl.integrations.inspection.loading import load_start
from codra_dsl.language.check import CheckedSpec
from codra_dsl.language.check.latency import worst_cases
from codra_dsl.language.model import Access, Resource, Usage, needed_of
from codra_dsl.runtime import ContextManager, SimClock
from tests.language.check.checked_specs import ShortAlgorithm, checked_spec, place, reference, setting
from tests.language.check.slow_perception import SlowHandle

ROOT = Path(__file__).parents[3]
MARGIN_S = 1e-4
LIMIT_S = 100_000.0


@dataclass(frozen=True)
class CompiledSpec:
    """A spec whose observers can be run."""

    spec: CheckedSpec
    start: Callable[..., ContextManager[Any, Any]]
    handles: Sequence[str]

    def known_after_s(
        self, variable: str, durations_s: Mapping[str, float], truths: Mapping[str, bool], limit_s: float
    ) -> float:
        """Declare one variable while no observer runs, and return how long it takes until it is known."""
        needed_result_counts = {
            name: max(map(needed_of, algorithm.algorithm.identifies))
            for name, algorithm in self.spec.algorithms.items()
        }
        clock, eyes = SimClock(), SlowHandle(durations_s, needed_result_counts)
        with self.start(clock=clock, resources=dict.fromkeys(self.handles, eyes)) as codra:
            for name, truth in truths.items():
                codra.set(name, truth)
            codra.declare(variable)
            is_known = clock.wait_until(lambda: codra.get(variable).known, limit_s)
            return clock.now_s() if is_known else math.inf


def compile_spec(folder: Path, text: str, parts: Mapping[str, str] | None = None) -> CompiledSpec:
    """Compile a spec in a separate folder and load the generated observers."""
    (folder / "specs").mkdir(parents=True)
    for name, part in {"spec.yaml": text, **(parts or {})}.items():
        (folder / "specs" / name).parent.mkdir(exist_ok=True)
        (folder / "specs" / name).write_text(part, encoding="utf-8")
    compilation = compile_paths([folder / "specs/spec.yaml"], folder)
    assert compilation.planned.plans, [finding.message for finding in compilation.planned.diagnostics]
    (plan,) = compilation.planned.plans
    handles = [resource.name for resource in plan.checked.spec.resources if resource.slots is None]
    return CompiledSpec(plan.checked, load_start(compilation.files, plan.name, folder / "generated"), handles)


def full_timeouts_s(spec: CheckedSpec) -> dict[str, float]:
    return {name: algorithm.algorithm.timeout_s - MARGIN_S for name, algorithm in spec.algorithms.items()}


# The laboratory


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> CompiledSpec:
    """The lab's own spec, with perception that takes its full timeout instead of the lab's perception."""
    slow_call, real_call = "call: tests.language.check.slow_perception:", "call: codra_papers.lab.perception.functions:"
    text, part = ((ROOT / "specs" / name).read_text("utf-8") for name in ("lab.yaml", "parts/machine.yaml"))
    assert real_call in text
    assert real_call in part
    folder = tmp_path_factory.mktemp("lab")
    return compile_spec(
        folder, text.replace(real_call, slow_call), {"parts/machine.yaml": part.replace(real_call, slow_call)}
    )


def test_the_bound_is_reached_by_every_variable_of_the_lab_that_waits_for_no_alternative(lab: CompiledSpec) -> None:
    bounds = worst_cases(lab.spec)

    observed_times_s = {
        name: lab.known_after_s(name, full_timeouts_s(lab.spec), {"robot_is_localized": True}, LIMIT_S)
        for name in bounds
    }

    assert len(bounds) == 14
    assert all(observed_times_s[name] <= bounds[name] for name in bounds), (bounds, observed_times_s)
    assert {name for name in bounds if observed_times_s[name] < bounds[name] - 0.001} == {
        "centrifuge_locked",  # these bounds include a look of the alternative for centrifuge_open
        "centrifuge_rotor_in_pos_1",
        "centrifuge_rotor_in_pos_2",
    }


def test_the_lid_is_known_after_distance_view_and_its_own_look(lab: CompiledSpec) -> None:
    assert worst_cases(lab.spec)["pcr_cycler_open"] == 1 + 3 + 8
    assert worst_cases(lab.spec)["centrifuge_open"] == 1 + 3 + 8


def test_the_rotor_can_wait_for_both_looks_at_the_lid(lab: CompiledSpec) -> None:
    assert worst_cases(lab.spec)["centrifuge_rotor_in_pos_1"] == 1 + 3 + 8 + 6 + 6


# Any spec


@dataclass(frozen=True)
class DrawnSpec:
    """A spec, the duration of each first look, and the algorithms that can run in this world."""

    text: str
    shares: Mapping[str, float]
    truths: Mapping[str, bool]


@dataclass
class Sketch:
    """A spec while it is drawn: each algorithm with its variables, needs and resources."""

    identifies: dict[str, list[str]] = field(default_factory=dict)
    conditions: dict[str, list[str]] = field(default_factory=dict)
    given: dict[str, list[str]] = field(default_factory=dict)
    slots: dict[str, list[str]] = field(default_factory=dict)
    timeouts_s: dict[str, int] = field(default_factory=dict)
    ranks: dict[str, int] = field(default_factory=dict)
    confirms: dict[str, int] = field(default_factory=dict)
    settings: list[str] = field(default_factory=list)

    @property
    def variables(self) -> list[str]:
        return sorted({name for names in self.identifies.values() for name in names})

    def text(self) -> str:
        context = [f"  {name}: {{type: bool, valid_for: forever}}" for name in self.variables]
        context += [
            f"  world_lets_{name}: {{type: bool, source: main_execution, valid_for: forever}}" for name in self.slots
        ]
        looks = [line for name in self.identifies for line in self._look(name)]
        observers = ["observers:", *self.settings] if self.settings else []
        lines = ["codra: 1", "name: drawn", "context:", *context, "resources:", "  eyes: {}", "  one: {slots: 1}"]
        return "\n".join([*lines, "  two: {slots: 2}", "perception:", *looks, *observers, ""])

    def _condition_text(self, name: str) -> str:
        needed_result_count = self.confirms[name]
        return (
            "seen"
            if needed_result_count == 1
            else f"{{enter: seen, confirm: {needed_result_count} of {needed_result_count + 1}}}"
        )

    def _look(self, name: str) -> list[str]:
        uses = ", ".join(["eyes: read", *(f"{slot}: slot" for slot in self.slots[name])])
        conditions = [f"world_lets_{name}", *self.conditions[name]]
        return [
            f"  {name}:",
            "    call: tests.language.check.slow_perception:see",
            f"    with: {{name: {name}}}",
            f"    uses: {{{uses}}}",
            f"    given: [{', '.join(self.given[name])}]",
            f"    timeout: {self.timeouts_s[name]} s",
            f"    rank: {self.ranks[name]}",
            "    returns: {seen: {type: bool}}",
            "    observable_when:",
            *(f"      - {condition}" for condition in conditions),
            "    identifies:",
            *(f"      {variable}: {self._condition_text(name)}" for variable in self.identifies[name]),
        ]


@st.composite
def drawn_specs(draw: st.DrawFn) -> DrawnSpec:
    """A chain or a web of algorithms: alternatives, feedback, slots, priorities, periods."""
    sketch = Sketch()
    for number in range(draw(st.integers(3, 6))):
        earlier_variables = sketch.variables if number > 1 else []  # two without needs, then others that need them
        variables = [f"v{number}{letter}" for letter in "ab"[: draw(st.integers(1, 2))]]
        for rank in range(1, 1 + draw(st.sampled_from([1, 1, 1, 2, 3]))):
            name = f"p{number}_{rank}"
            sketch.identifies[name] = (
                variables if rank == 1 else draw(st.lists(st.sampled_from(variables), min_size=1, unique=True))
            )
            needs = (
                draw(st.lists(st.sampled_from(earlier_variables), min_size=1, max_size=3, unique=True))
                if earlier_variables
                else []
            )
            sketch.conditions[name] = [
                draw(st.sampled_from(["{}", "known({})", "{0} or {0}"])).format(need) for need in needs
            ]
            sketch.given[name] = (
                draw(st.lists(st.sampled_from(earlier_variables), max_size=1)) if earlier_variables else []
            )
            sketch.slots[name] = draw(st.sampled_from([["one"], [], ["one"], ["two"], ["one", "two"]]))
            sketch.confirms[name] = draw(st.sampled_from([1, 1, 1, 1, 2, 3]))
            sketch.timeouts_s[name], sketch.ranks[name] = draw(st.integers(1, 9)), rank
        period_s, priority = draw(st.integers(1, 4)), draw(st.integers(0, 3))
        setting_text = f"{{identifies: [{', '.join(variables)}], period: {period_s} s, priority: {priority}}}"
        sketch.settings.append(f"  tree_{number}: {setting_text}")
    if draw(st.booleans()):
        first, last = "p0_1", sketch.variables[-1]
        sketch.conditions[first].append(f"not known({last}) or {last}")
    shares = {name: draw(st.sampled_from([0.2, 1.0, 1.0, 1.0])) for name in sketch.identifies}
    truths = {
        f"world_lets_{name}": draw(st.sampled_from([True, True, True, True, False])) for name in sketch.identifies
    }
    return DrawnSpec(sketch.text(), shares, truths)


def reachable_variables(spec: CheckedSpec, truths: Mapping[str, bool]) -> set[str]:
    """Return the variables that can be known in this world, by trying until nothing changes."""
    known_names = {name for name, truth in truths.items() if truth}
    while True:
        runnable_algorithms = (
            algorithm for algorithm in spec.algorithms.values() if known_names.issuperset(algorithm.waits_for)
        )
        new_names = {name for algorithm in runnable_algorithms for name, _ in algorithm.identifies} - known_names
        if not new_names:
            return known_names
        known_names |= new_names


@settings(max_examples=15)
@given(drawn_spec=drawn_specs())
def test_no_variable_takes_longer_than_its_bound(
    drawn_spec: DrawnSpec, tmp_path_factory: pytest.TempPathFactory
) -> None:
    compiled_spec = compile_spec(tmp_path_factory.mktemp("drawn"), drawn_spec.text)
    bounds = worst_cases(compiled_spec.spec)
    durations_s = {
        name: drawn_spec.shares[name] * full_s for name, full_s in full_timeouts_s(compiled_spec.spec).items()
    }
    knowable_names = reachable_variables(compiled_spec.spec, drawn_spec.truths)

    for name, bound_s in bounds.items():
        if name in knowable_names:
            taken_s = compiled_spec.known_after_s(name, durations_s, drawn_spec.truths, bound_s + 1.0)

            assert taken_s <= bound_s, (name, bound_s)
            event(f"{round(10 * taken_s / bound_s)} tenths of the bound")


# Waiting for slots, and for alternatives


@dataclass(frozen=True)
class Look:
    name: str
    identifies: str
    timeout_s: float
    needs: str = ""
    slots: str = ""
    rank: int = 1


def spec_of(*looks: Look) -> CheckedSpec:
    resources = [Resource(name=name, place=place(), slots=slots) for name, slots in (("one", 1), ("two", 2))]
    return checked_spec(map(short_algorithm, looks), resources=resources)


def short_algorithm(look: Look) -> ShortAlgorithm:
    uses = [Usage(resource=reference(slot), access=Access.SLOT, place=place()) for slot in look.slots.split()]
    identifies, needs = look.identifies.split(), look.needs.split()
    return ShortAlgorithm(
        name=look.name, identifies=identifies, needs=needs, uses=uses, timeout_s=look.timeout_s, rank=look.rank
    )


@pytest.mark.parametrize(
    ("looks", "bound_s"),
    [
        ([Look("p", "x", 3)], 3),
        ([Look("p", "a", 3), Look("q", "x", 4, "a")], 7),
        ([Look("p", "a", 3), Look("q", "b", 5), Look("r", "x", 4, "a b")], 9),
        ([Look("p", "a", 3, slots="one"), Look("q", "b", 5, slots="one"), Look("r", "x", 4, "a b")], 12),
        ([Look("p", "a", 3), Look("q", "b", 1, slots="one"), Look("r", "x", 1, "a b", "one")], 5),
        ([Look("p", "a", 3, slots="two"), Look("q", "b", 5, slots="two"), Look("r", "x", 4, "a b")], 9),
        ([Look("p", "a", 6, slots="two"), Look("q", "b", 6, slots="two"), Look("r", "x", 6, "a b", "two")], 15),
        ([Look("p", "x", 3), Look("q", "x", 8, rank=2)], 8),
        ([Look("p", "x y", 3), Look("q", "y", 8, rank=2)], 11),
        ([Look("p", "x", 3, slots="one"), Look("other", "y", 90, slots="one")], 3),
        ([Look("p", "x", 3, "given")], 3),
    ],
    ids=[
        "one look",
        "a chain",
        "two paths, the longer counts",
        "two paths through one slot",
        "beside the slot and then through it",
        "two slots are enough for two",
        "three looks for two slots: two on the path, and half of the other look that can delay them",
        "the slower of two alternatives",
        "a variable of only the first alternative waits until the other one has looked",
        "an algorithm that does not run takes no slot",
        "a variable from the main execution takes no time",
    ],
)
def test_the_bound_is_the_longest_path_with_all_its_delays(looks: list[Look], bound_s: float) -> None:
    assert worst_cases(spec_of(*looks))["x"] == bound_s


def test_a_joined_tree_runs_all_its_looks() -> None:
    uses = [Usage(resource=reference("one"), access=Access.SLOT, place=place())]
    algorithms = [
        ShortAlgorithm(name=name, identifies=[name[-1]], uses=uses, timeout_s=4.0) for name in ("see_x", "see_y")
    ]
    one_slot = [Resource(name="one", place=place(), slots=1)]

    separate_bounds = worst_cases(checked_spec(algorithms, resources=one_slot))
    joined_bounds = worst_cases(checked_spec(algorithms, resources=one_slot, observers=[setting("both", "x", "y")]))

    assert (separate_bounds["x"], joined_bounds["x"]) == (4.0, 8.0)


def test_looks_of_alternatives_that_wait_for_one_another_count_once() -> None:
    looks = [Look("p", "x", 2, "y"), Look("q", "x", 3, rank=2), Look("r", "y", 5, "x")]

    assert worst_cases(spec_of(*looks))["y"] == 2 + 3 + 5


def test_a_chain_of_ten_thousand_looks_through_one_slot_gets_a_bound_that_is_not_too_small() -> None:
    """The number of looks is far beyond the limit of visited looks."""
    names = [f"v{number}" for number in range(10_000)]
    chain = [Look("p0", "v0", 1.0, slots="one")]
    chain += [Look(f"p{number}", names[number], 1.0, names[number - 1], "one") for number in range(1, 10_000)]

    bounds = worst_cases(spec_of(*chain))

    assert bounds["v9"] == 10.0
    assert bounds["v9999"] == 10_000.0
