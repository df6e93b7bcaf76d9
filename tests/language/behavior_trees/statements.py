"""Statements about nodes from BehaviorTree.CPP's documentation and unit tests, as hand-written tables of ticks.

The parts of `rows` are separated by bars: `running: A b C!` is a tick with its events (`A` is started, `b` continues,
`C!` is halted), `halt: A!` halts the tree, `y=1` writes an entry, `y==1` reads one, `y==` expects that it is missing.
Each tick takes 100 ms.
"""

from __future__ import annotations

from dataclasses import dataclass

from tests.language.behavior_trees.btcpp import Quirk


@dataclass(frozen=True)
class Statement:
    """A tree, the results of its actions (`A=RRS B=F`), the expected rows, and other trees that it uses."""

    tree: str
    plans: str
    rows: str
    others: str = ""


CHECK = """<BehaviorTree ID="Check"><Sequence><Fallback><WasEntryUpdated entry="{y}"/><A/></Fallback>
  <SkipUnlessUpdated entry="{y}"><B/></SkipUnlessUpdated></Sequence></BehaviorTree>"""
STATEMENTS = {
    "Sequence: a running child is ticked again, earlier ones are not": Statement(
        "<Sequence><A/><B/><C/></Sequence>", "A=S B=RRS C=S", "running: A B | running: b | success: b C"
    ),
    "Sequence: restarts after a failure": Statement(
        "<Sequence><A/><B/></Sequence>", "A=S B=FS", "failure: A B | success: A B"
    ),
    "SequenceWithMemory: the failed child is ticked again, earlier ones are not": Statement(
        "<SequenceWithMemory><A/><B/><C/></SequenceWithMemory>",
        "A=S B=FFS C=S",
        "failure: A B | failure: B | success: B C",
    ),
    "SequenceWithMemory: keeps its place over a halt": Statement(
        "<SequenceWithMemory><A/><B/></SequenceWithMemory>", "A=S B=RS", "running: A B | halt: B! | success: B"
    ),
    "Sequence: forgets its place at a halt": Statement(
        "<Sequence><A/><B/></Sequence>", "A=S B=RS", "running: A B | halt: B! | success: A B"
    ),
    "ReactiveSequence: starts from the first in every tick": Statement(
        "<ReactiveSequence><A/><B/></ReactiveSequence>", "A=SSF B=R", "running: A B | running: A b | failure: A B!"
    ),
    "ReactiveSequence: a child that turns running halts the others": Statement(
        "<ReactiveSequence><A/><B/></ReactiveSequence>", "A=SR B=R", "running: A B | running: A B!"
    ),
    "Fallback: the failed ones are not ticked again while one runs": Statement(
        "<Fallback><A/><B/></Fallback>", "A=F B=RF", "running: A B | failure: b"
    ),
    "ReactiveFallback: interrupts when an earlier one succeeds": Statement(
        "<ReactiveFallback><A/><B/></ReactiveFallback>", "A=FS B=R", "running: A B | success: A B!"
    ),
    "a skipped child of a Sequence is passed over": Statement(
        '<Sequence><A _skipIf="true"/><B/></Sequence>', "A=F B=S", "success: B"
    ),
    "a Sequence of skipped children is skipped": Statement(
        '<Sequence><A _skipIf="true"/><B _skipIf="true"/></Sequence>', "", "skipped: | skipped:"
    ),
    "a Fallback of skipped children is skipped": Statement('<Fallback><A _skipIf="true"/></Fallback>', "", "skipped:"),
    "Fallback: skipped and failed is failed": Statement(
        '<Fallback><A _skipIf="true"/><B/></Fallback>', "B=F", "failure: B"
    ),
    "ReactiveSequence skips again in each tick": Statement(
        '<ReactiveSequence><A _skipIf="true"/><B/></ReactiveSequence>', "B=RRS", "running: B | running: b | success: b"
    ),
    "_skipIf is asked of an idle node only": Statement(
        '<ReactiveSequence><Script code="x += 1"/><A _skipIf="x > 1"/></ReactiveSequence>',
        "A=RRS",
        "x=0 | running: A | running: a | success: a",
    ),
    "_while interrupts": Statement(
        '<ReactiveSequence><Script code="x:=1"/><C/><A _while="y == 1" _onHalted="z:=7"/></ReactiveSequence>',
        "C=S A=R",
        "y=1 | running: C A | y=0 | success: C A! | z==7",
    ),
    "an interrupted child of a Sequence is passed over": Statement(
        '<Sequence><A _while="y == 1"/><B/></Sequence>', "A=R B=S", "y=1 | running: A | y=0 | success: A! B"
    ),
    "the tree is skipped when its root is interrupted": Statement(
        '<A _while="y == 1"/>', "A=R", "y=1 | running: A | y=0 | skipped: A! | skipped: | y=1 | running: A"
    ),
    "failure before success before skip": Statement(
        '<A _skipIf="true" _successIf="true" _failureIf="true"/>', "", "failure:"
    ),
    "success before skip": Statement('<A _skipIf="true" _successIf="true"/>', "", "success:"),
    "post scripts run for a status that a precondition gave": Statement(
        '<ForceSuccess><A _failureIf="true" _onFailure="p := 1" _post="q := 1"/></ForceSuccess>',
        "",
        "success: | p==1 | q==1",
    ),
    "post scripts do not run for a skipped node": Statement(
        '<Sequence><Script code="p:=0"/><A _skipIf="true" _post="p:=1"/><B/></Sequence>', "B=S", "success: B | p==0"
    ),
    "_onHalted runs for a running node that is halted, and _post does not": Statement(
        '<Parallel failure_count="1"><A _onHalted="p := 1" _post="p := 2"/><B/></Parallel>',
        "A=R B=F",
        "failure: A B A! | p==1",
    ),
    "_onHalted does not run for a completed node": Statement(
        '<Sequence><Script code="p:=0"/><A _onHalted="p:=1"/><B/></Sequence>',
        "A=S B=R",
        "running: A B | halt: B! | p==0",
    ),
    "Parallel: all must succeed by default": Statement(
        "<Parallel><A/><B/></Parallel>", "A=S B=RS", "running: A B | success: b"
    ),
    "Parallel: one failure fails by default, the rest is halted": Statement(
        "<Parallel><A/><B/><C/></Parallel>", "A=R B=F C=S", "failure: A B A!"
    ),
    "Parallel: success at the threshold, later children are not ticked": Statement(
        '<Parallel success_count="1"><A/><B/><C/></Parallel>', "A=R B=S C=S", "success: A B A!"
    ),
    "Parallel: fails once success is out of reach": Statement(
        '<Parallel success_count="2" failure_count="3"><A/><B/><C/></Parallel>', "A=F B=F C=R", "failure: A B"
    ),
    "Parallel: -2 is all but one": Statement(
        '<Parallel success_count="-2" failure_count="2"><A/><B/><C/></Parallel>', "A=S B=R C=S", "success: A B C B!"
    ),
    "Parallel: completed children wait for the others": Statement(
        '<Parallel failure_count="2"><A/><B/><C/></Parallel>',
        "A=S B=RRS C=RS",
        "running: A B C | running: b c | success: b",
    ),
    "Parallel: a skipped child counts where all must succeed": Statement(
        '<Parallel><A _skipIf="true"/><B/></Parallel>', "B=RS", "running: B | success: b"
    ),
    "ParallelAll: all run to their end": Statement(
        '<ParallelAll max_failures="1"><A/><B/><C/></ParallelAll>',
        "A=F B=RS C=RRS",
        "running: A B C | running: b c | failure: c",
    ),
    "ParallelAll: fewer failures than allowed succeed": Statement(
        '<ParallelAll max_failures="2"><A/><B/></ParallelAll>', "A=F B=RS", "running: A B | success: b"
    ),
    "ParallelAll of skipped children is skipped": Statement(
        '<ParallelAll><A _skipIf="true"/></ParallelAll>', "", "skipped:"
    ),
    "IfThenElse: the condition is asked once": Statement(
        "<IfThenElse><C/><A/><B/></IfThenElse>",
        "C=SF A=RRS B=S",
        "running: C A | running: a | success: a | success: C B",
    ),
    "IfThenElse: without else a failed condition fails": Statement(
        "<IfThenElse><C/><A/></IfThenElse>", "C=F", "failure: C | failure: C"
    ),
    "IfThenElse: a running condition is asked again": Statement(
        "<IfThenElse><C/><A/></IfThenElse>", "C=RS A=S", "running: C | success: c A"
    ),
    "WhileDoElse: halts the branch when the condition changes": Statement(
        "<WhileDoElse><ScriptCondition code='y == 1'/><A/><B/></WhileDoElse>",
        "A=R B=R",
        "y=1 | running: A | running: a | y=0 | running: A! B | y=1 | running: B! A",
    ),
    "WhileDoElse: without else it fails": Statement(
        "<WhileDoElse><ScriptCondition code='y == 1'/><A/></WhileDoElse>", "A=R", "y=1 | running: A | y=0 | failure: A!"
    ),
    "Switch: halts the running case when the variable changes": Statement(
        '<Switch2 variable="{v}" case_1="1" case_2="2"><A/><B/><C/></Switch2>',
        "A=R B=R C=S",
        "v=1 | running: A | v=2 | running: A! B | running: b | v=3 | success: B! C",
    ),
    "Switch: a skipped case skips the switch": Statement(
        '<Switch2 variable="{v}" case_1="1" case_2="2"><A _skipIf="true"/><B/><C/></Switch2>', "C=S", "v=1 | skipped:"
    ),
    "Inverter": Statement("<Inverter><A/></Inverter>", "A=RSF", "running: A | failure: a | success: A"),
    "ForceSuccess and ForceFailure let running pass": Statement(
        "<Sequence><ForceSuccess><A/></ForceSuccess><ForceFailure><B/></ForceFailure></Sequence>",
        "A=RF B=RS",
        "running: A | running: a B | failure: b",
    ),
    "forcing lets a skip pass": Statement('<ForceFailure><A _skipIf="true"/></ForceFailure>', "", "skipped:"),
    "Repeat: N times in one tick": Statement('<Repeat num_cycles="3"><A/></Repeat>', "A=S", "success: A A A"),
    "Repeat: a failure ends it and the count": Statement(
        '<Repeat num_cycles="2"><A/></Repeat>', "A=SFSS", "failure: A A | success: A A"
    ),
    "Repeat: through the root, so that conditions are asked between cycles": Statement(
        '<ReactiveSequence><C/><Repeat num_cycles="3"><A/></Repeat></ReactiveSequence>',
        "C=SSF A=S",
        "failure: C A C A C",
    ),
    "Repeat: an asynchronous child starts its next cycle in the same tick": Statement(
        '<Repeat num_cycles="2"><A/></Repeat>', "A=RSRS", "running: A | running: a A | success: a"
    ),
    "Repeat: a skip is passed on": Statement('<Repeat num_cycles="2"><A _skipIf="true"/></Repeat>', "", "skipped:"),
    "Repeat: nothing to do succeeds": Statement('<Repeat num_cycles="0"><A/></Repeat>', "", "success:"),
    "Retry: until success": Statement(
        '<RetryUntilSuccessful num_attempts="3"><A/></RetryUntilSuccessful>', "A=FFS", "success: A A A"
    ),
    "Retry: all attempts used": Statement(
        '<RetryUntilSuccessful num_attempts="2"><A/></RetryUntilSuccessful>', "A=F", "failure: A A"
    ),
    "Retry: forgets its count at a halt": Statement(
        '<RetryUntilSuccessful num_attempts="2"><A/></RetryUntilSuccessful>',
        "A=RFRRFF",
        "running: A | running: a A | halt: A! | running: A | failure: a A",
    ),
    "KeepRunningUntilFailure": Statement(
        "<KeepRunningUntilFailure><A/></KeepRunningUntilFailure>",
        "A=SRSF",
        "running: A | running: A | running: a | failure: A",
    ),
    "Delay: the child starts when the time has passed": Statement(
        '<Delay delay_msec="150"><A/></Delay>', "A=S", "running: | running: | success: A | running:"
    ),
    "Timeout: halts and fails": Statement(
        '<Timeout msec="150"><A/></Timeout>', "A=R", "running: A | running: a | failure: A! | running: A"
    ),
    "Timeout: a child in time": Statement(
        '<Timeout msec="250"><A/></Timeout>', "A=RRS", "running: A | running: a | success: a"
    ),
    "RunOnce skips afterwards": Statement(
        "<Sequence><RunOnce><A/></RunOnce><B/></Sequence>", "A=RF B=S", "running: A | failure: a | success: B"
    ),
    "RunOnce returns the same forever": Statement(
        '<RunOnce then_skip="false"><A/></RunOnce>', "A=RF", "running: A | failure: a | failure: | failure:"
    ),
    "Precondition: the status of else": Statement(
        '<Precondition if="y == 1" else="SUCCESS"><A/></Precondition>', "A=F", "y=0 | success: | y=1 | failure: A"
    ),
    "Precondition: asked only before its child starts": Statement(
        '<Precondition if="y == 1" else="FAILURE"><A/></Precondition>',
        "A=RS",
        "y=1 | running: A | y=0 | success: a | failure:",
    ),
    "! takes its operand alone": Statement('<ScriptCondition code="!y == 0"/>', "", "y=1 | success:"),
    "a remapped entry is the parent's": Statement(
        '<Sequence><Script code="v:=1"/><SubTree ID="T" w="{v}"/></Sequence>',
        "",
        "success: | v==5",
        others='<BehaviorTree ID="T"><Script code="w:=5"/></BehaviorTree>',
    ),
    "an entry that is not remapped stays inside": Statement(
        '<Sequence><Script code="v:=1"/><SubTree ID="T"/></Sequence>',
        "",
        "success: | v==1",
        others='<BehaviorTree ID="T"><Script code="v:=5"/></BehaviorTree>',
    ),
    "_autoremap shares every name": Statement(
        '<Sequence><Script code="v:=1"/><SubTree ID="T" _autoremap="true"/></Sequence>',
        "",
        "success: | v==5",
        others='<BehaviorTree ID="T"><Script code="v:=5"/></BehaviorTree>',
    ),
    "_autoremap leaves private names inside": Statement(
        '<Sequence><Script code="_v:=1"/><SubTree ID="T" _autoremap="true"/></Sequence>',
        "",
        "success: | _v==1",
        others='<BehaviorTree ID="T"><Script code="_v:=5"/></BehaviorTree>',
    ),
    "a subtree's preconditions are read in the parent": Statement(
        '<Sequence><Script code="v:=1"/><SubTree ID="T" _skipIf="v == 1"/><B/></Sequence>',
        "B=S",
        "success: B",
        others='<BehaviorTree ID="T"><A/></BehaviorTree>',
    ),
    "halting goes from the left and inwards first": Statement(
        '<Parallel><Sequence _onHalted="o:=1"><A _onHalted="o:=2"/></Sequence><B/></Parallel>',
        "A=R B=R",
        "running: A B | halt: A! B! | o==1",
    ),
    # unit tests of the library: updates of entries, preconditions in loops, remapped truths, skipping again and again
    "an entry is updated once for each node that asks": Statement(
        '<SubTree ID="Check" _autoremap="true"/>',
        "",
        "success: A | y=1 | success: B | success: A",
        others=CHECK,
    ),
    "a second cycle sees no update where nothing was written": Statement(
        """<Sequence><Script code="y := 1"/>
          <Repeat num_cycles="2"><SubTree ID="Check" _autoremap="true"/></Repeat></Sequence>""",
        "",
        "success: B A",
        others=CHECK,
    ),
    "a cycle that writes sees its own update": Statement(
        """<Repeat num_cycles="2"><Sequence><Script code="y := 1"/>
          <SubTree ID="Check" _autoremap="true"/></Sequence></Repeat>""",
        "",
        "success: B B",
        others=CHECK,
    ),
    "Precondition asks again in each cycle": Statement(
        """<Repeat num_cycles="3"><Sequence><Precondition if="x == 0" else="SUCCESS"><A/></Precondition>
          <B _while="z == 0"/><C _while="y == 0"/></Sequence></Repeat>""",
        "B=R C=R",
        "x=0 | y=0 | z=1 | running: A C | x=1 | y=1 | z=0 | running: C! B | x=0 | z=1 | success: B! A",
    ),
    "a truth is remapped as an entry or as a text": Statement(
        """<Sequence><Script code="p := true"/><SubTree ID="T" w="{p}"/><SubTree ID="T" w="true"/>
          <SubTree ID="T" w="false"/></Sequence>""",
        "",
        "success: A A",
        others='<BehaviorTree ID="T"><Sequence><A _skipIf="w != true"/></Sequence></BehaviorTree>',
    ),
    "a loop is paused from beside it": Statement(
        """<Parallel><Sequence><A/><Script code="paused := false"/><B/></Sequence>
          <Sequence><Script code="paused := true; done := 0"/><RetryUntilSuccessful num_attempts="-1" _while="paused"
            _onHalted="done = 1"><C/></RetryUntilSuccessful></Sequence></Parallel>""",
        "A=RS B=RS C=R",
        "running: A C | running: a B C! | done==1 | success: b",
    ),
    "a root is skipped as often as its child is": Statement(
        '<Sequence><A _skipIf="y == 1"/></Sequence>',
        "",
        "y=1 | skipped: | y=0 | success: A | y=1 | skipped: | y=0 | success: A",
    ),
    "a running node is not skipped": Statement(
        '<A _skipIf="y == 0"/>', "A=R", "y=0 | skipped: | y=1 | running: A | y=0 | running: a"
    ),
}

DEPARTURES = {
    Quirk.SKIPPED_KEEPS_RUNNING: (
        Statement(
            '<Sequence><Script code="h := 0"/><Sequence _onHalted="h := 1"><A/></Sequence><B/></Sequence>',
            "A=K",
            "success: A B | h==0",
        ),
        "success: A B | h==1",
    ),
    Quirk.WAKE_UP_PENDS: (
        Statement(
            '<Parallel success_count="1"><Repeat num_cycles="2"><A/></Repeat><B/></Parallel>',
            "A=SR B=SR",
            "success: A B | running: A B",
        ),
        "success: A B | running: A B a b",
    ),
    Quirk.LATCHED_PRECONDITION: (
        Statement(
            '<Precondition if="y == 1"><A/></Precondition>', "A=R", "y=1 | running: A | halt: A! | y=0 | failure:"
        ),
        "y=1 | running: A | halt: A! | y=0 | running: A",
    ),
    Quirk.SKIPPED_CONDITION_THROWS: (Statement("<IfThenElse><A/><B/></IfThenElse>", "A=K", "skipped: A"), "throws: A"),
    Quirk.FAILED_CONDITION_STAYS: (
        Statement('<IfThenElse><A _failureIf="y == 1"/><B/></IfThenElse>', "", "y=1 | failure: | failure:"),
        "y=1 | failure: | success: A B",
    ),
    Quirk.COMPLETED_ACTION_REPEATS: (
        Statement("<WhileDoElse><A/><B/></WhileDoElse>", "A=SF B=R", "running: A B | failure: A B!"),
        "running: A B | running: b",
    ),
    Quirk.TIMERS_SURVIVE_SKIP: (
        Statement('<Delay delay_msec="100"><A/></Delay>', "A=KS", "running: | skipped: A | running: | success: A"),
        "running: | skipped: A | success: A",
    ),
    Quirk.UPDATED_HALTS_NOTHING: (
        Statement('<WaitValueUpdate entry="y"><A/></WaitValueUpdate>', "A=R", "y=1 | running: A | halt: A!"),
        "y=1 | running: A | halt:",
    ),
    Quirk.LOOP_LEAVES_CHILD: (
        Statement(
            '<Repeat num_cycles="{y}"><A/></Repeat>', "A=RSR", "y=2 | running: A | running: a A | y=1 | success: A!"
        ),
        "y=2 | running: A | running: a A | y=1 | success:",
    ),
    Quirk.SKIPS_STAY_COUNTED: (
        Statement(
            "<WhileDoElse><Fallback><A/><B/></Fallback><C/></WhileDoElse>",
            "A=K B=SF C=R",
            "running: A B C | failure: A B C!",
        ),
        "running: A B C | skipped: A B C!",
    ),
    Quirk.UNSET_IS_LOCAL: (
        Statement(
            '<SubTree ID="Sub" v="{y}"/>',
            "",
            "y=1 | success: | y==",
            others='<BehaviorTree ID="Sub"><UnsetBlackboard key="v"/></BehaviorTree>',
        ),
        "y=1 | success: | y==1",
    ),
}
"""For each quirk of the source, a tree that shows the quirk, with our behaviour and the behaviour of the source."""
