"""Random trees against a second interpreter, which was written from the documentation and shares no code with ours."""

from __future__ import annotations

from random import Random

from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.runtime import SimClock
from codra_dsl.runtime.trees import Action, Ports, Result, Robot, Scope, Tree
from tests.trees.reference import Reference
from tests.trees.stories import document, main_tree, planned

FLAGS = ("p", "q", "r")
ASKED = ("_failureIf", "_successIf", "_skipIf", "_while")
DONE = ("_onSuccess", "_onFailure", "_post", "_onHalted")
SEVERAL = (
    *("Sequence", "AsyncSequence", "SequenceWithMemory", "ReactiveSequence"),
    *(
        "Fallback",
        "AsyncFallback",
        "ReactiveFallback",
        "Parallel",
        "ParallelAll",
        "IfThenElse",
        "WhileDoElse",
        "Switch2",
    ),
)
ONE = (
    *("Inverter", "ForceSuccess", "ForceFailure", "KeepRunningUntilFailure", "Repeat", "RetryUntilSuccessful"),
    *("RunOnce", "Precondition", "Delay", "Timeout"),
)
LEAVES = "ABCDE"
STEP_MS = 125


def conditions(chance: Random) -> str:
    """Now and then a condition, and something to be told."""
    asked = [name for name in ASKED if chance.random() < 0.06]
    done = [name for name in DONE if chance.random() < 0.15]
    flags = [f' {name}="{chance.choice(["", "!"])}{chance.choice(FLAGS)}"' for name in asked]
    return "".join([*flags, *(f' {name}="{chance.randrange(100)}"' for name in done)])


def node(chance: Random, depth: int) -> str:
    """A random node with what is below it, at most so deep."""
    kind = chance.random()
    if kind < 0.05:
        return f'<Sleep msec="{milliseconds(chance)}"{conditions(chance)}/>'
    if depth == 0 or kind < 0.15:
        return f"<{chance.choice(LEAVES)}{conditions(chance)}/>"
    return several(chance, depth - 1) if kind < 0.7 else one(chance, depth - 1)


def milliseconds(chance: Random) -> int:
    """A duration of some steps, which floats keep exactly."""
    return STEP_MS * chance.randrange(5)


def several(chance: Random, depth: int) -> str:
    tag = chance.choice(SEVERAL)
    count = 3 if tag == "Switch2" else chance.randint(2, 3)

    def threshold() -> int:
        return chance.choice([number for number in range(-count, count + 1) if number])

    ports = {
        "Parallel": f' success_count="{threshold()}" failure_count="{threshold()}"',
        "Switch2": f' variable="{{v}}" case_1="{chance.randrange(3)}" case_2="{chance.randrange(3)}"',
        "ParallelAll": f' max_failures="{threshold()}"',
    }
    children = "".join(node(chance, depth) for _ in range(count))
    return f"<{tag}{ports.get(tag, '')}{conditions(chance)}>{children}</{tag}>"


def one(chance: Random, depth: int) -> str:
    tag = chance.choice(ONE)
    rounds = chance.choice([-1, 0, 1, 2, 3])
    result = chance.choice(["SUCCESS", "FAILURE", "SKIPPED", "RUNNING"])
    ports = {
        "Repeat": f' num_cycles="{rounds}"',
        "RetryUntilSuccessful": f' num_attempts="{rounds}"',
        "Delay": f' delay_msec="{milliseconds(chance)}"',
        "Timeout": f' msec="{milliseconds(chance)}"',
        "RunOnce": f' then_skip="{chance.choice(["true", "false"])}"',
        "Precondition": f' if="{chance.choice(FLAGS)}" else="{result}"',
    }
    return f"<{tag}{ports.get(tag, '')}{conditions(chance)}>{node(chance, depth)}</{tag}>"


def plan(chance: Random) -> dict[str, str]:
    """What each leaf comes to, tick by tick; in the end each runs for ever, so that no loop does."""
    return {leaf: "".join(chance.choices("RSFK", [4, 3, 3, 1], k=20)) + "R" for leaf in LEAVES}


chances = st.integers(0, 10**9).map(Random)
bodies = chances.map(lambda chance: node(chance, chance.randint(1, 3)))


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


@settings(max_examples=400, deadline=None)
@given(chances)
def test_random_trees_do_the_same_tick_by_tick(chance: Random) -> None:
    log: list[str] = []
    scope = Logged(log)
    flags = dict.fromkeys(FLAGS, False)
    body, letters = node(chance, chance.randint(2, 3)), plan(chance)
    robot = planned(" ".join(f"{leaf}={each}" for leaf, each in letters.items()), log)
    clock = SimClock()
    tree = main_tree(document(scripted(body)), robot, scope=scope, clock=clock)
    reference = Reference(body, {leaf: list(each) for leaf, each in letters.items()}, flags)

    for _ in range(15):
        for name in FLAGS:
            flags[name] = chance.random() < 0.5
            scope.create(name, flags[name])
        reference.variable = str(chance.choice([0, 0, 1, 2]))
        scope.create("v", reference.variable)
        clock.sleep(STEP_MS / 1000)
        reference.now_ms += STEP_MS
        if chance.random() < 0.1:
            tree.halt()
            reference.halt()
        assert (tree.tick_exactly_once().value, log) == (reference.tick(), reference.log), body


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
@given(chances)
def test_a_halted_tree_leaves_no_action_running(chance: Random) -> None:
    Endless.running = 0
    robot = Robot()
    for leaf in LEAVES:
        robot.can(leaf, Endless)
    scope = Scope()
    scope.create("v", 0)
    tree: Tree = main_tree(document(scripted(node(chance, 3))), robot, scope=scope)
    for _ in range(5):
        for name in FLAGS:
            scope.create(name, chance.random() < 0.5)
        tree.tick_exactly_once()
    tree.halt()

    assert Endless.running == 0
