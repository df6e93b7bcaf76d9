"""Random trees as XML, with conditions, scripts and subtrees, and the results of the robot's actions."""

from __future__ import annotations

from random import Random
from xml.sax.saxutils import quoteattr

from tests.language.behavior_trees.stories import document

SEVERAL = (
    *("Sequence", "AsyncSequence", "SequenceWithMemory", "ReactiveSequence"),
    *("Fallback", "AsyncFallback", "ReactiveFallback"),
    *("Parallel", "ParallelAll", "IfThenElse", "WhileDoElse", "Switch"),
)
ONE = (
    *("Inverter", "ForceSuccess", "ForceFailure", "KeepRunningUntilFailure", "Repeat", "RetryUntilSuccessful"),
    *("RunOnce", "Precondition", "Delay", "Timeout", "SkipUnlessUpdated", "WaitValueUpdate"),
    *("LoopInt", "LoopDouble", "LoopBool", "LoopString", "SubTree"),
)
ASKED = ("_failureIf", "_successIf", "_skipIf", "_while")
DONE = ("_onSuccess", "_onFailure", "_post", "_onHalted")
ACTIONS = "ABCDE"
ENTRIES = "xyz"
"""Entries with numbers; the entry `t` is a text to which scripts append a log."""

STEP_MS = 125
"""Durations are multiples of this, which floats represent exactly."""


class RandomTree:
    """A random tree `Main` with its subtrees and plans of actions."""

    def __init__(self, chance: Random, depth: int) -> None:
        self._chance = chance
        self._scripts = 0
        self._subtrees: list[str] = []
        body = self._node(depth)
        self.text = document(body, others="".join(self._subtrees))
        self.plans = " ".join(f"{leaf}={''.join(chance.choices('RSFK', [4, 4, 3, 1], k=24))}R" for leaf in ACTIONS)
        """The results of each action, one letter per tick. The last letter `R` repeats, so few loops are endless."""

    def _node(self, depth: int) -> str:
        kind = self._chance.random()
        if depth == 0 or kind < 0.15:
            return self._leaf()
        return self._several(depth - 1) if kind < 0.65 else self._one(depth - 1)

    def _element(self, tag: str, ports: dict[str, str], children: str = "") -> str:
        """Return an element with its ports and children, and sometimes with conditions."""
        chance = self._chance
        asked = {name: self._condition(2) for name in ASKED if chance.random() < 0.05}
        done = {name: self._script() for name in DONE if chance.random() < 0.12}
        attributes = "".join(f" {name}={quoteattr(value)}" for name, value in {**ports, **asked, **done}.items())
        return f"<{tag}{attributes}>{children}</{tag}>"

    # Scripts

    def _operand(self, depth: int = 1) -> str:
        kind = self._chance.random()
        if kind < 0.6:
            return self._chance.choice(ENTRIES)
        if kind < 0.85 or depth == 0:
            return self._chance.choice(["0", "1", "2", "-1", "0.5", "true", "false"])
        return f"({self._operand(depth - 1)} {self._chance.choice('+-*')} {self._operand(depth - 1)})"

    def _condition(self, depth: int) -> str:
        kind = self._chance.random()
        if kind < 0.6 or depth == 0:
            sign = self._chance.choice(["==", "!=", "<", "<=", ">", ">="])
            return f"{self._operand()} {sign} {self._operand()}"
        first, second = self._condition(depth - 1), self._condition(depth - 1)
        if kind < 0.7:
            return f"!({first})"
        if kind < 0.8:
            return f"({first}) ? ({second}) : ({self._condition(depth - 1)})"
        return f"({first}) {self._chance.choice(['&&', '||'])} ({second})"

    def _statement(self) -> str:
        kind = self._chance.random()
        entry = self._chance.choice(ENTRIES)
        if kind < 0.5:
            self._scripts += 1
            return f"t += 'n{self._scripts} '"
        if kind < 0.8:
            return f"{entry} {self._chance.choice([':=', '='])} {self._operand()}"
        return f"{entry} {self._chance.choice(['+=', '-='])} {self._chance.choice('012')}"

    def _script(self) -> str:
        return "; ".join(self._statement() for _ in range(self._chance.choice([1, 1, 2])))

    # Nodes

    def _entry(self) -> str:
        return f"{{{self._chance.choice(ENTRIES)}}}"

    def _ms(self) -> str:
        return str(STEP_MS * self._chance.randrange(4))

    def _leaf(self) -> str:
        chance = self._chance
        ports = {
            "Script": {"code": self._script()},
            "ScriptCondition": {"code": self._condition(2)},
            "SetBlackboard": {"output_key": chance.choice(ENTRIES), "value": chance.choice(["0", "2", "{x}", "{y}"])},
            "WasEntryUpdated": {"entry": self._entry()},
            "Sleep": {"msec": self._ms()},
            chance.choice(["AlwaysSuccess", "AlwaysFailure"]): {},
        }
        tag = chance.choice(ACTIONS) if chance.random() < 0.62 else chance.choice(list(ports))
        return self._element(tag, ports.get(tag, {}))

    def _several(self, depth: int) -> str:
        chance = self._chance
        tag = chance.choice(SEVERAL)
        cases = chance.choice([2, 2, 2, 3, 4, 5, 6])
        count = {"Switch": cases + 1, "IfThenElse": chance.randint(2, 3), "WhileDoElse": chance.randint(2, 3)}.get(
            tag, chance.randint(1, 4)
        )
        threshold = [str(number) for number in range(-count, count + 1) if number]
        values = ["0", "1", "2", "3", "1.0", "{y}"]
        ports = {
            "Parallel": {"success_count": chance.choice(threshold), "failure_count": chance.choice(threshold)},
            "ParallelAll": {"max_failures": chance.choice(threshold)},
            "Switch": {
                "variable": self._entry(),
                **{f"case_{number}": chance.choice(values) for number in range(1, cases + 1)},
            },
        }
        kept = ports.get(tag, {}) if tag == "Switch" or chance.random() < 0.8 else {}
        children = "".join(self._node(depth if count < 4 else min(depth, 1)) for _ in range(count))
        return self._element(f"Switch{cases}" if tag == "Switch" else tag, kept, children)

    def _one(self, depth: int) -> str:
        chance = self._chance
        tag = chance.choice(ONE)
        if tag == "SubTree":
            return self._subtree(depth)
        rounds = chance.choice(["-1", "0", "1", "2", "3", "{z}"])
        result = chance.choice(["SUCCESS", "FAILURE", "SKIPPED", "RUNNING"])
        queue = {"queue": chance.choice(["1;0", "0;1;1", "1"]), "value": self._entry(), "if_empty": result}
        ports = {
            "Repeat": {"num_cycles": rounds},
            "RetryUntilSuccessful": {"num_attempts": rounds},
            "Delay": {"delay_msec": self._ms()},
            "Timeout": {"msec": self._ms()},
            "RunOnce": {"then_skip": chance.choice(["true", "false"])},
            "Precondition": {"if": self._condition(2), "else": result},
            "SkipUnlessUpdated": {"entry": self._entry()},
            "WaitValueUpdate": {"entry": self._entry()},
        }
        return self._element(tag, queue if tag.startswith("Loop") else ports.get(tag, {}), self._node(depth))

    def _subtree(self, depth: int) -> str:
        """Return a subtree that can access all entries, by their own names or by other names."""
        name = f"Sub{len(self._subtrees)}"
        self._subtrees.append("")
        self._subtrees[int(name[3:])] = f'<BehaviorTree ID="{name}">{self._node(depth)}</BehaviorTree>'
        crossed = {"x": self._entry(), "y": self._entry()}
        if self._chance.random() < 0.4:
            return self._element("SubTree", {"ID": name, "_autoremap": "true", **crossed})
        return self._element("SubTree", {"ID": name, "t": "{t}", "z": "{=}", **crossed})
