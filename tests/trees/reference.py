"""A second interpreter of trees, small and slow, written from BehaviorTree.CPP's pages and from nothing of ours.

It reads XML with the standard library, keeps all it knows in one dictionary a node, and is a single recursive function.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable
from typing import Any

IDLE, RUN, OK, BAD, SKIP = "idle", "running", "success", "failure", "skipped"
DONE = (OK, BAD)


class Reference:
    """Ticks one tree. Leaves and flags are asked through callbacks; `log` has the same words as ours."""

    def __init__(self, xml: str, plans: dict[str, list[str]], flags: dict[str, bool]) -> None:
        self.root = ET.fromstring(xml)
        self.plans = plans
        self.flags = flags
        self.log: list[str] = []
        self.now_ms = 0
        self.variable = "0"
        self.memory: dict[ET.Element, dict[str, Any]] = {}

    def tick(self) -> str:
        """Tick the root exactly once; a completed root is idle afterwards."""
        result = self.visit(self.root)
        if result in DONE:
            self.reset(self.root)
        return result

    def halt(self) -> None:
        """Halt the root if it runs."""
        self.reset(self.root)

    def of(self, element: ET.Element) -> dict[str, Any]:
        """What is known of a node."""
        return self.memory.setdefault(element, {"status": IDLE})

    def truth(self, text: str) -> bool:
        """A condition is a flag, or `!` and a flag."""
        return not self.flags[text[1:]] if text.startswith("!") else self.flags[text]

    # A node with its conditions

    def visit(self, element: ET.Element) -> str:
        """`_failureIf` -> `_successIf` -> `_skipIf` -> `_while`, the tick, then `_onSuccess`, `_onFailure`, `_post`."""
        known = self.of(element)
        result = None
        if known["status"] == IDLE:
            for name, comes_to in (("_failureIf", BAD), ("_successIf", OK), ("_skipIf", SKIP)):
                if name in element.attrib and self.truth(element.attrib[name]):
                    result = comes_to
                    break
        waits = element.attrib.get("_while")
        if result is None and waits is not None and known["status"] in (IDLE, RUN) and not self.truth(waits):
            self.reset(element)
            result = SKIP
        if result is None:
            result = (
                self.action(element) if element.tag in self.plans else getattr(self, f"tick_{element.tag}")(element)
            )
        for name, when in (("_onSuccess", [OK]), ("_onFailure", [BAD]), ("_post", DONE)):
            if result in when and name in element.attrib:
                self.log.append(element.attrib[name])
        known["status"] = IDLE if result == SKIP else result
        return result

    def reset(self, element: ET.Element) -> None:
        """A running node is halted: what it remembers goes, its children are halted, `_onHalted` runs."""
        known = self.of(element)
        if known["status"] == RUN:
            keeps = {"turn": known.get("turn", 0)} if element.tag == "SequenceWithMemory" else {}
            keeps |= {"came_to": known["came_to"]} if "came_to" in known else {}
            known.clear()
            known.update(keeps)
            if element.tag in self.plans:
                self.log.append(f"{element.tag}!")
            for child in element:
                self.reset(child)
            if "_onHalted" in element.attrib:
                self.log.append(element.attrib["_onHalted"])
        known["status"] = IDLE

    def reset_all(self, element: ET.Element) -> None:
        """All children are halted if they run, and idle."""
        for child in element:
            self.reset(child)

    def action(self, element: ET.Element) -> str:
        """One letter of its plan a tick, the last one for ever."""
        self.log.append(element.tag.lower() if self.of(element)["status"] == RUN else element.tag)
        plan = self.plans[element.tag]
        letter = plan.pop(0) if len(plan) > 1 else plan[0]
        return {"R": RUN, "S": OK, "F": BAD, "K": SKIP}[letter]

    # Sequences and fallbacks

    def in_order(self, element: ET.Element, on: str, *, yields: bool, remembers: bool) -> str:
        """The table of the pages: what restarts, and what is ticked again."""
        known, children = self.of(element), list(element)
        if known["status"] != RUN:
            known["skips"] = 0
        while known.setdefault("turn", 0) < len(children):
            child = children[known["turn"]]
            fresh = self.of(child)["status"] == IDLE
            result = self.visit(child)
            if result == RUN:
                return RUN
            if result in DONE and result != on:
                for other in children[known["turn"] if remembers else 0 :]:
                    self.reset(other)
                known["turn"] = known["turn"] if remembers else 0
                return result
            known["turn"] += 1
            if result == SKIP:
                known["skips"] += 1
            elif yields and fresh and known["turn"] < len(children):
                return RUN
        every = known["skips"] == len(children)
        self.reset_all(element)
        known["turn"] = known["skips"] = 0
        return SKIP if every else on

    def tick_Sequence(self, element: ET.Element) -> str:  # noqa: N802
        return self.in_order(element, OK, yields=False, remembers=False)

    def tick_AsyncSequence(self, element: ET.Element) -> str:  # noqa: N802
        return self.in_order(element, OK, yields=True, remembers=False)

    def tick_SequenceWithMemory(self, element: ET.Element) -> str:  # noqa: N802
        return self.in_order(element, OK, yields=True, remembers=True)

    def tick_Fallback(self, element: ET.Element) -> str:  # noqa: N802
        return self.in_order(element, BAD, yields=False, remembers=False)

    def tick_AsyncFallback(self, element: ET.Element) -> str:  # noqa: N802
        return self.in_order(element, BAD, yields=True, remembers=False)

    def reactive(self, element: ET.Element, on: str) -> str:
        """From the first child at each tick; the running one alone is not halted."""
        results = []
        for child in element:
            results.append(self.visit(child))
            if results[-1] == RUN:
                for other in element:
                    if other is not child:
                        self.reset(other)
                return RUN
            if results[-1] in DONE and results[-1] != on:
                self.reset_all(element)
                return results[-1]
        self.reset_all(element)
        return SKIP if set(results) == {SKIP} else on

    def tick_ReactiveSequence(self, element: ET.Element) -> str:  # noqa: N802
        return self.reactive(element, OK)

    def tick_ReactiveFallback(self, element: ET.Element) -> str:  # noqa: N802
        return self.reactive(element, BAD)

    # Parallel

    def tick_Parallel(self, element: ET.Element) -> str:  # noqa: N802
        known, count = self.of(element), len(element)
        given = int(element.get("success_count", "-1"))
        lost = int(element.get("failure_count", "1"))
        need = count + 1 + given if given < 0 else given
        lose = count + 1 + lost if lost < 0 else lost
        done: dict[int, str] = known.setdefault("done", {})
        skips = 0
        for index, child in enumerate(element):
            if index not in done:
                result = self.visit(child)
                skips += result == SKIP
                if result in DONE:
                    done[index] = result
            good = sum(each == OK for each in done.values())
            bad = len(done) - good
            enough = good >= need or (given < 0 and good + skips >= need)
            if enough or count - bad < need or bad >= lose:
                done.clear()
                self.reset_all(element)
                return OK if enough else BAD
        return SKIP if skips == count else RUN

    def tick_ParallelAll(self, element: ET.Element) -> str:  # noqa: N802
        known, count = self.of(element), len(element)
        most = int(element.get("max_failures", "1"))
        done: dict[int, str] = known.setdefault("done", {})
        skips = 0
        for index, child in enumerate(element):
            if index not in done:
                result = self.visit(child)
                skips += result == SKIP
                if result in DONE:
                    done[index] = result
        if skips == count:
            return SKIP
        if skips + len(done) < count:
            return RUN
        bad = sum(each == BAD for each in done.values())
        done.clear()
        self.reset_all(element)
        return BAD if bad >= (count + 1 + most if most < 0 else most) else OK

    # Conditional

    def tick_IfThenElse(self, element: ET.Element) -> str:  # noqa: N802
        known = self.of(element)
        if not known.get("answer"):
            asked = self.visit(element[0])
            if asked not in DONE:
                return asked
            known["answer"] = asked
        index = 1 if known["answer"] == OK else 2
        result = self.visit(element[index]) if index < len(element) else BAD
        if result != RUN:
            known["answer"] = None
            self.reset_all(element)
        return result

    def tick_WhileDoElse(self, element: ET.Element) -> str:  # noqa: N802
        asked = self.visit(element[0])
        if asked == RUN:
            return RUN
        if asked == SKIP:
            self.reset_all(element)
            return SKIP
        take, leave = (1, 2) if asked == OK else (2, 1)
        if leave < len(element):
            self.reset(element[leave])
        result = self.visit(element[take]) if take < len(element) else BAD
        if result != RUN:
            self.reset_all(element)
        return result

    # Decorators

    def child(self, element: ET.Element) -> str:
        """Tick the child; it is idle again when it has ended."""
        result = self.visit(element[0])
        if result != RUN:
            self.reset(element[0])
        return result

    def turned(self, element: ET.Element, turn: Callable[[str], str]) -> str:
        return turn(self.child(element))

    def tick_Inverter(self, element: ET.Element) -> str:  # noqa: N802
        return self.turned(element, lambda result: {OK: BAD, BAD: OK}.get(result, result))

    def tick_ForceSuccess(self, element: ET.Element) -> str:  # noqa: N802
        return self.turned(element, lambda result: OK if result in DONE else result)

    def tick_ForceFailure(self, element: ET.Element) -> str:  # noqa: N802
        return self.turned(element, lambda result: BAD if result in DONE else result)

    def tick_KeepRunningUntilFailure(self, element: ET.Element) -> str:  # noqa: N802
        return self.turned(element, lambda result: BAD if result == BAD else RUN)

    def rounds(self, element: ET.Element, again: str, limit: int) -> str:
        known = self.of(element)
        while known.setdefault("rounds", 0) < limit or limit == -1:
            fresh = self.of(element[0])["status"] == IDLE
            result = self.child(element)
            if result in (RUN, SKIP):
                return result
            if result != again:
                known["rounds"] = 0
                return result
            known["rounds"] += 1
            if fresh and (known["rounds"] < limit or limit == -1):
                return RUN
        known["rounds"] = 0
        return again

    def tick_Repeat(self, element: ET.Element) -> str:  # noqa: N802
        return self.rounds(element, OK, int(element.attrib["num_cycles"]))

    def tick_RetryUntilSuccessful(self, element: ET.Element) -> str:  # noqa: N802
        return self.rounds(element, BAD, int(element.attrib["num_attempts"]))

    def tick_RunOnce(self, element: ET.Element) -> str:  # noqa: N802
        known = self.of(element)
        if "came_to" in known:
            return SKIP if element.get("then_skip", "true") == "true" else known["came_to"]
        result = self.child(element)
        if result in DONE:
            known["came_to"] = result
        return result

    def tick_Precondition(self, element: ET.Element) -> str:  # noqa: N802
        if self.of(element[0])["status"] == RUN or self.truth(element.attrib["if"]):
            return self.child(element)
        return element.get("else", "FAILURE").lower()

    # Time

    def tick_Sleep(self, element: ET.Element) -> str:  # noqa: N802
        known = self.of(element)
        if self.now_ms < known.setdefault("due", self.now_ms + int(element.attrib["msec"])):
            return RUN
        del known["due"]
        return OK

    def tick_Delay(self, element: ET.Element) -> str:  # noqa: N802
        known = self.of(element)
        if self.now_ms < known.setdefault("due", self.now_ms + int(element.attrib["delay_msec"])):
            return RUN
        result = self.child(element)
        if result != RUN:
            del known["due"]
        return result

    def tick_Timeout(self, element: ET.Element) -> str:  # noqa: N802
        known, limit = self.of(element), int(element.attrib["msec"])
        if self.now_ms >= known.get("due", self.now_ms + 1):
            del known["due"]
            self.reset_all(element)
            return BAD
        known.setdefault("due", self.now_ms + limit if limit else 10**9)
        result = self.child(element)
        if result != RUN:
            del known["due"]
        return result

    # Switch

    def tick_Switch2(self, element: ET.Element) -> str:  # noqa: N802
        known = self.of(element)
        chosen = {element.attrib["case_2"]: 1, element.attrib["case_1"]: 0}.get(self.variable, 2)
        if known.get("at", chosen) != chosen:
            self.reset(element[known["at"]])
        result = self.visit(element[chosen])
        known.pop("at", None)
        if result == RUN:
            known["at"] = chosen
        if result in DONE:
            self.reset_all(element)
        return result
