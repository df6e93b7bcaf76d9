"""Random trees compared with a second, independently written interpreter, which shares no code with our runtime."""

from __future__ import annotations

from random import Random

from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.runtime.behavior_trees import Action, Ports, Result, Robot, Scope
from tests.language.behavior_trees.pairs import Both
from tests.language.behavior_trees.random_trees import ACTIONS, ENTRIES, STEP_MS, RandomTree
from tests.language.behavior_trees.stories import main_tree

chances = st.integers(0, 10**9).map(Random)
trees = chances.map(lambda chance: RandomTree(chance, chance.randint(1, 4)))


@settings(max_examples=150, deadline=None)
@given(chances)
def test_random_trees_do_the_same_tick_by_tick(chance: Random) -> None:
    random_tree = RandomTree(chance, chance.choice([1, 1, 2, 2, 3, 4]))
    both = Both(random_tree)
    for entry in ENTRIES:
        both.write(entry, float(chance.randrange(3)))
    exactly_once = chance.random() < 0.4

    for _ in range(15):
        if chance.random() < 0.3:
            both.write(chance.choice(ENTRIES), float(chance.randrange(3)))
        both.wait(STEP_MS * chance.randrange(3))
        if chance.random() < 0.1:
            both.halt()
        results = both.tick(exactly_once=exactly_once)
        if results is None:
            break
        assert results[0] == results[1], random_tree.text


class Endless(Action):
    """An action that never completes. It counts the running actions of its kind."""

    running = 0

    def start(self, _: Ports) -> Result:
        Endless.running += 1
        return Result.RUNNING

    def go_on(self, _: Ports) -> Result:
        return Result.RUNNING

    def halt(self, _: Ports) -> None:
        Endless.running -= 1


@settings(max_examples=40, deadline=None)
@given(chances)
def test_a_halted_tree_leaves_no_action_running(chance: Random) -> None:
    Endless.running = 0
    robot = Robot()
    for leaf in ACTIONS:
        robot.can(leaf, Endless)
    scope = Scope()
    scope.create("t", "")
    tree = main_tree(RandomTree(chance, 3).text, robot, scope=scope)
    for _ in range(5):
        for name in ENTRIES:
            scope.create(name, float(chance.randrange(3)))
        tree.tick_exactly_once()
    tree.halt()

    assert Endless.running == 0
