"""The run of a story in simulated time, with the main execution that the story describes or with a program."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from functools import partial
from typing import Any, Protocol, Self

from codra_dsl.integrations.testing.checks import Failure, failures_of, failures_text
from codra_dsl.integrations.testing.handles import alter, make_stated_handle
from codra_dsl.integrations.testing.loops import StoryLoops
from codra_dsl.integrations.testing.package import Package
from codra_dsl.integrations.testing.script import Script, StoryAgents
from codra_dsl.integrations.testing.timeline import (
    AgentValues,
    Alteration,
    Behaviour,
    Change,
    Clearing,
    DecisionArguments,
    GraphChange,
    LeafBehaviour,
    LoopSwitch,
    Moment,
    Overriding,
    Step,
    Story,
    Timeline,
    Verb,
)
from codra_dsl.language.diagnostics import Place
from codra_dsl.runtime import ContextManager, EventLog, SimClock
from codra_dsl.runtime.perception.site_handles import with_site_handles

__all__ = ["OpenStory", "Run", "StoryFailed"]


class StoryFailed(AssertionError):  # noqa: N818 - a failed test shows this name
    """A check of a story failed; the message shows the expected value, the actual value, and the reason."""


class OpenStory(Protocol):
    """The type of the fixture `codra_story`."""

    def __call__(self, path: str, story: str | None = None, *, resources: Mapping[str, object] | None = None) -> Run:
        """Return a story, ready to run.

        Args:
            path: the path of a timeline, from the folder of the test.
            story: the name of the story; not needed if the timeline has only one story.
            resources: handles that replace those of the timeline.
        """
        ...


class Run:
    """A story in which a program runs: `with codra_story("carry.yaml") as run: program(run.codra, run.clock)`.

    At the end of the `with` statement, time passes until the last moment, and then all checks are made.

    Attributes:
        codra: the context manager.
        clock: the clock on which the story runs.
        resources: the handles, by resource.
        record: the event log of the run.
    """

    codra: ContextManager[Any, Any]
    record: EventLog
    _loops: StoryLoops

    def __init__(
        self, timeline: Timeline, package: Package, story: Story, *, clock: SimClock, resources: Mapping[str, object]
    ) -> None:
        """Prepare a story; nothing runs yet."""
        self.clock = clock
        self.resources = dict(resources)
        self._timeline = timeline
        self._package = package
        self._story = story
        self._script = Script(story.scripted_algorithms, self.resources)
        self._start_s = math.nan
        self._end_s_by_moment: dict[int, float] = {}
        self._skills: dict[str, _Skill] = {}

    def __enter__(self) -> Self:
        self._make_handles()
        self.start(clock=self.clock, resources=self.resources)
        return self

    def __exit__(self, exception_type: object, *_: object) -> None:
        __tracebackhide__ = True
        with self.codra, closing(self._loops):
            if exception_type is None:
                self.until(self._story.end_s)
                self.check()

    def start(
        self,
        *,
        clock: SimClock,
        resources: Mapping[str, object],
        seed: int | None = None,
        record: EventLog | None = None,
    ) -> ContextManager[Any, Any]:
        """Start the observers in the story's world. A program calls this instead of the generated `start`.

        Args:
            clock: the story begins at the present instant of this clock.
            resources: handles by name, for perception functions that the timeline does not script.
            seed: the seed of random numbers; if None, the seed of the timeline.
            record: the event log; by default a new one without limit.

        Raises:
            TypeError: if the clock is not a simulated one.
            ValueError: if the timeline has steps of a main execution after the beginning, because the program is the
                main execution.
            CallError: for the same reasons as the generated `start`.
        """
        if not isinstance(clock, SimClock):
            raise TypeError("a story runs in simulated time: give it a SimClock")
        later_moment = next((moment for moment in self._story.moments if moment.at_s > 0 and moment.steps), None)
        if later_moment is not None:
            span = later_moment.steps[0].place.span
            raise ValueError(
                f"{span.file}:{span.line}: a program is the main execution here: remove 'main_execution' after 0 s"
            )
        codra = self._begin(clock, resources, self._timeline.seed if seed is None else seed, record)
        for moment in self._story.moments:
            for step in moment.steps:
                self._perform_step(step)
        return codra

    def until(self, instant_s: float) -> None:
        """Let time pass until an instant of the story, counted from its beginning."""
        end_s = self._start_s + instant_s
        while self.clock.now_s() < end_s:
            self.clock.sleep(end_s - self.clock.now_s())
        self.clock.sleep(0.0)

    def check(self) -> None:
        """Make all checks.

        Raises:
            StoryFailed: if a check fails.
        """
        __tracebackhide__ = True
        failures: list[Failure] = []
        for index, moment in enumerate(self._story.moments):
            at_s = self._end_s_by_moment.get(index, self._start_s + moment.at_s)
            failures += failures_of(moment, at_s, self.clock.now_s(), self.codra, self.record)
        failures += [
            _unscripted_failure(self._story.place, name, at_s) for name, at_s in self._script.unscripted_since_s.items()
        ]
        if failures:
            raise StoryFailed(failures_text(failures, self._timeline.source))

    def play(self) -> None:
        """Run the story with the main execution that it describes, and make all checks.

        Raises:
            StoryFailed: if a check fails, or an action of the main execution is not possible.
        """
        __tracebackhide__ = True
        self._make_handles()
        with ExitStack() as stack:
            stack.enter_context(self._begin(self.clock, self.resources, self._timeline.seed, None))
            stack.enter_context(closing(self._loops))
            for index, moment in enumerate(self._story.moments):
                self.until(moment.at_s)
                for step in moment.steps:
                    self._perform_step(step)
                self._end_s_by_moment[index] = self.clock.now_s()
            self.clock.sleep(0.0)
            self.check()

    # Internals

    def _begin(
        self, clock: SimClock, resources: Mapping[str, object], seed: int, record: EventLog | None
    ) -> ContextManager[Any, Any]:
        if not math.isnan(self._start_s):
            raise RuntimeError("this story has been started: open it again")
        self.clock, self.resources, self._start_s = clock, dict(resources), clock.now_s()
        self._script = Script(self._story.scripted_algorithms, self.resources)
        self.record = EventLog(math.inf) if record is None else record
        self.codra = self._package.build(
            self._package.model,
            clock=clock,
            resources={**dict.fromkeys(self._package.handles), **resources},
            seed=seed,
            record=self.record,
            find=self._script.function_for,
            knowledge=self._package.knowledge,
            hosts_here=True,
        )
        story_agents = StoryAgents(self.codra, clock, self._timeline.repeat_intervals_s, self._refusals_at)
        self._loops = StoryLoops(self.codra, self._package.mape, clock)
        for moment in self._story.moments:
            if moment.at_s > 0:
                # The world changes after all other events at an instant, so a look that starts then sees the old state.
                clock.call_last_at(self._start_s + moment.at_s, partial(self._apply_changes, moment, story_agents))
            else:
                self._apply_changes(moment, story_agents)
        return self.codra

    def _make_handles(self) -> None:
        """Make the handles that were not passed.

        The handles that the site states are made for algorithms that the story does not script.
        """
        for handle in self._timeline.handles:
            if handle.resource not in self.resources:
                self.resources[handle.resource] = make_stated_handle(handle, self.clock)
        algorithms = self._package.algorithms.values()
        unscripted = (algorithm for algorithm in algorithms if algorithm.name not in self._story.scripted_algorithms)
        needed_handles = {handle for algorithm in unscripted for handle in algorithm.handles}
        resources = [resource for resource in self._package.model.resources if resource.name in needed_handles]
        self.resources.update(with_site_handles(resources, self.resources, self.clock))

    def _apply_changes(self, moment: Moment, story_agents: StoryAgents) -> None:
        """Apply the changes of the world at a moment."""
        __tracebackhide__ = True
        for change in moment.changes:
            with self._refusals_at(change):
                self._apply(change, story_agents)

    def _apply(self, change: Change, story_agents: StoryAgents) -> None:
        match change:
            case AgentValues():
                story_agents.apply(change)
            case Behaviour():
                self._script.change(change)
            case Overriding():
                self.codra.override(change.variable, change.value, for_s=change.for_s, reason=change.reason)
            case Clearing():
                self.codra.clear_override(change.variable)
            case Alteration():
                alter(self.resources.get(change.resource), change)
            case GraphChange():
                story_agents.change_graph(change)
            case LoopSwitch():
                self._loops.switch(change)
            case LeafBehaviour():
                self._loops.robot.behaviours[change.leaf] = change

    @contextmanager
    def _refusals_at(self, change: Change) -> Iterator[None]:
        """Let the story fail at the place of a change that the knowledge graph or the context manager refuses."""
        __tracebackhide__ = True
        try:
            yield
        except (LookupError, ValueError, PermissionError, RuntimeError) as error:
            if not isinstance(change, (AgentValues, GraphChange, LoopSwitch)):
                raise
            refuses = "the loop cannot run" if isinstance(change, LoopSwitch) else "the graph does not allow this"
            message = f"{refuses}: {type(error).__name__}: {error}"
            raise StoryFailed(failures_text([Failure(change.place, message)], self._timeline.source)) from error

    def _perform_step(self, step: Step) -> None:
        """Perform a step of the main execution."""
        __tracebackhide__ = True
        try:
            if step.verb is Verb.DECIDE:
                self._decide(step.names[0], step.decision_arguments)
            elif step.verb is Verb.SET:
                self.codra.set(step.names[0], step.value)
            elif step.verb is Verb.EXPECT:
                self.codra.expect(*step.names)
            else:
                for name in step.names:
                    self._perform_step_for(step.verb, name)
        except Exception as error:
            message = f"'{step.verb}' is not possible: {type(error).__name__}: {error}"
            raise StoryFailed(failures_text([Failure(step.place, message)], self._timeline.source)) from error

    def _perform_step_for(self, verb: Verb, name: str) -> None:
        match verb:
            case Verb.DECLARE:
                self.codra.declare(name)
            case Verb.WITHDRAW:
                self.codra.withdraw(name)
            case Verb.PREVIEW:
                self.codra.preview(name)
            case Verb.BEGIN:
                self._skills[name] = _Skill(self.codra, name)
            case Verb.ACT:
                self._skills[name].act()
            case Verb.ACTED:
                self._skills[name].acting_stack.close()
            case _:
                self._skills.pop(name).end()

    def _decide(self, name: str, decision_arguments: DecisionArguments) -> None:
        self.codra.decide(
            name,
            otherwise=lambda: decision_arguments.otherwise,
            max_age_s=decision_arguments.max_age_s,
            since_s=self._start_s + decision_arguments.since_s,
            wait_up_to_s=decision_arguments.wait_up_to_s,
            shadow=decision_arguments.shadow,
        )


class _Skill:
    """A running skill."""

    def __init__(self, codra: ContextManager[Any, Any], name: str) -> None:
        self.acting_stack = ExitStack()
        self._skill_stack = ExitStack()
        self._skill = self._skill_stack.enter_context(codra.skill(name))

    def act(self) -> None:
        self.acting_stack.enter_context(self._skill.acting())

    def end(self) -> None:
        self.acting_stack.close()
        self._skill_stack.close()


def _unscripted_failure(place: Place, algorithm: str, at_s: float) -> Failure:
    message = f"{algorithm} looked at {at_s:g} s, but the values that it returns are not stated"
    return Failure(place, message, "add them under `perception`, or make the handles that it reads under `resources`")
