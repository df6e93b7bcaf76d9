"""Random trees against a second interpreter, which was written from the documentation and shares no code with ours."""

from __future__ import annotations

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from codra_dsl.runtime.trees import Action, Ports, Result, Robot, Scope, Tree
from tests.trees.reference import Reference
from tests.trees.stories import document, main_tree, planned

FLAGS = ("p", "q", "r")
ASKED = ("_failureIf", "_successIf", "_skipIf", "_while")
DONE = ("_onSuccess", "_onFailure", "_post", "_onHalted")
SEVERAL = (
    *("Sequence", "AsyncSequence", "SequenceWithMemory", "ReactiveSequence"),
    *("Fallback", "AsyncFallback", "ReactiveFallback", "Parallel", "ParallelAll", "IfThenElse", "WhileDoElse"),
)
ONE = (
    *("Inverter", "ForceSuccess", "ForceFailure", "KeepRunningUntilFailure", "Repeat", "RetryUntilSuccessful"),
    *("RunOnce", "Precondition"),
)
LEAVES = "ABCDE"


@st.composite
def conditions(draw: st.DrawFn) -> str:
    asked = draw(st.lists(st.sampled_from(ASKED), max_size=2, unique=True))
    done = draw(st.lists(st.sampled_from(DONE), max_size=2, unique=True))
    flags = [f' {name}="{draw(st.sampled_from(["", "!"]))}{draw(st.sampled_from(FLAGS))}"' for name in asked]
    return "".join([*flags, *(f' {name}="{draw(st.integers(0, 99))}"' for name in done)])


@st.composite
def several(draw: st.DrawFn, below: st.SearchStrategy[str]) -> str:
    tag = draw(st.sampled_from(SEVERAL))
    least = 2 if tag in ("IfThenElse", "WhileDoElse") else 1
    children = draw(st.lists(below, min_size=least, max_size=3))
    count = len(children)
    ports = ""
    threshold = st.integers(-count, count).filter(bool)
    if tag == "Parallel":
        ports = f' success_count="{draw(threshold)}" failure_count="{draw(threshold)}"'
    if tag == "ParallelAll":
        ports = f' max_failures="{draw(threshold)}"'
    return f"<{tag}{ports}{draw(conditions())}>{''.join(children)}</{tag}>"


@st.composite
def one(draw: st.DrawFn, below: st.SearchStrategy[str]) -> str:
    tag = draw(st.sampled_from(ONE))
    rounds = draw(st.sampled_from([-1, 0, 1, 2, 3]))
    result = draw(st.sampled_from(["SUCCESS", "FAILURE", "SKIPPED", "RUNNING"]))
    ports = {
        "Repeat": f' num_cycles="{rounds}"',
        "RetryUntilSuccessful": f' num_attempts="{rounds}"',
        "RunOnce": f' then_skip="{draw(st.sampled_from(["true", "false"]))}"',
        "Precondition": f' if="{draw(st.sampled_from(FLAGS))}" else="{result}"',
    }
    return f"<{tag}{ports.get(tag, '')}{draw(conditions())}>{draw(below)}</{tag}>"


leaves = st.builds("<{}{}/>".format, st.sampled_from(LEAVES), conditions())
bodies = st.recursive(leaves, lambda below: st.one_of(several(below), one(below)), max_leaves=9)
plans = st.fixed_dictionaries({leaf: st.text(alphabet="RRSSFFK", min_size=1, max_size=8) for leaf in LEAVES})
steps = st.lists(st.tuples(st.fixed_dictionaries({flag: st.booleans() for flag in FLAGS}), st.booleans()), max_size=9)


def scripted(body: str) -> str:
    """A body whose numbered scripts write the entry `done`, which tells the log."""
    for name in DONE:
        for number in range(100):
            body = body.replace(f'{name}="{number}"', f"{name}=\"done := '{number}'\"")
    return body


class Logged(Scope):
    """A scope that tells a log what scripts write to the entry `done`."""

    def __init__(self, log: list[str]) -> None:
        super().__init__()
        self._log = log

    def create(self, name: str, value: object) -> None:
        if name == "done":
            self._log.append(str(value))
        super().create(name, value)


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(bodies, plans, steps)
def test_random_trees_do_the_same_tick_by_tick(
    body: str, plan: dict[str, str], story: list[tuple[dict[str, bool], bool]]
) -> None:
    log: list[str] = []
    scope = Logged(log)
    flags = dict.fromkeys(FLAGS, False)
    robot = planned(" ".join(f"{leaf}={letters}" for leaf, letters in plan.items()), log)
    tree = main_tree(document(scripted(body)), robot, scope=scope)
    reference = Reference(body, {leaf: list(letters) for leaf, letters in plan.items()}, flags)

    for present, halts in story:
        flags.update(present)
        for name, value in present.items():
            scope.create(name, value)
        if halts:
            tree.halt()
            reference.halt()
        assert (tree.tick_exactly_once().value, log) == (reference.tick(), reference.log)


class Endless(Action):
    """An action that counts how often it was started and stopped."""

    running = 0

    def start(self, _: Ports) -> Result:
        Endless.running += 1
        return Result.RUNNING

    def go_on(self, _: Ports) -> Result:
        return Result.RUNNING

    def halt(self, _: Ports) -> None:
        Endless.running -= 1


@settings(max_examples=100, deadline=None)
@given(bodies, steps)
def test_a_halted_tree_leaves_no_action_running(body: str, story: list[tuple[dict[str, bool], bool]]) -> None:
    Endless.running = 0
    robot = Robot()
    for leaf in LEAVES:
        robot.can(leaf, Endless)
    scope = Scope()
    tree: Tree = main_tree(document(scripted(body)), robot, scope=scope)
    for present, _ in story:
        for name, value in present.items():
            scope.create(name, value)
        tree.tick_exactly_once()
    tree.halt()

    assert Endless.running == 0
