"""Read one moment of a timeline: its YAML nodes become changes, steps and checks that fit the compiled spec."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from typing import Any

from codra_dsl.integrations.testing.package import Package
from codra_dsl.integrations.testing.placements import PlacementReader
from codra_dsl.integrations.testing.timeline import (
    AgentValues,
    Alteration,
    Behaviour,
    Belief,
    Change,
    Check,
    Clearing,
    DecisionArguments,
    ExpectationCheck,
    Fault,
    LeafBehaviour,
    LoopSwitch,
    Moment,
    Outcome,
    Overriding,
    PreviewCheck,
    RunningCheck,
    Step,
    Verb,
)
from codra_dsl.integrations.testing.values import (
    read_anything,
    read_difference,
    read_garbage,
    read_value,
    unknown_name_help,
)
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.yaml.findings import Findings, list_names
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, SequenceNode, YamlNode
from codra_dsl.language.load.yaml.origin import Subject
from codra_dsl.language.load.yaml.reader import Reader, entries
from codra_dsl.language.model import Literal
from codra_dsl.language.units import parse_duration
from codra_dsl.runtime import Reason
from codra_dsl.runtime.behavior_trees import Result
from codra_dsl.runtime.context.overrides import MAX_OVERRIDE_S
from codra_dsl.runtime.observers.expectations import Outcome as ExpectationOutcome
from codra_dsl.runtime.values.model import ValueType

_SKILL_VERBS = (Verb.EXPECT, Verb.BEGIN, Verb.ACT, Verb.ACTED, Verb.END, Verb.PREVIEW)
_ANY_REASON = "any"
_UNKNOWN_OVERRIDE_HELP = "remove 'is': an override without a value makes the context-variable unknown"
_RUNS = "runs"


class MomentReader:
    """Reads the moments of one file."""

    def __init__(self, package: Package, subject: Subject, findings: Findings) -> None:
        """Read moments for a compiled spec; findings refer to `subject`."""
        self._missing_prefix = f"spec {shown(package.model.name)} has no"
        self._variables = package.variables
        self._declared_names: Mapping[str, Collection[str]] = {
            "context-variable": self._variables,
            "handle": package.handles,
            "agent": package.agents,
            "skill": [skill.name for skill in package.model.skills],
            "observer": [observer.name for observer in package.model.observers],
            "loop": [loop.name for loop in package.mape.loops] if package.mape is not None else [],
        }
        self._package = package
        self._subject = subject
        self._findings = findings
        self._place = subject.origin.of
        self._placements = PlacementReader(package.knowledge, self._missing_prefix, subject, findings)

    def read(self, at_s: float, key: ScalarNode, node: YamlNode, *steps: str) -> Moment:
        """Return the readable parts of a moment; `steps` is the path of the moment in the file."""
        sections = {name: value for name, (_, value) in node.entries.items()} if isinstance(node, MappingNode) else {}

        def read_section(name: str, read: Callable[..., Iterable[Any]]) -> tuple[Any, ...]:
            return tuple(read(sections[name], (*steps, name))) if name in sections else ()

        return Moment(
            at_s=at_s,
            place=self._place(key),
            changes=(
                *read_section("resources", self._alterations),
                *read_section("agents", self._agent_values),
                *read_section("perception", self._behaviours),
                *read_section("overrides", self._overrides),
                *read_section("poses", self._placements.changes),
                *read_section("leaves", self._leaf_behaviours),
                *read_section("loops", self._loop_switches),
            ),
            steps=read_section("main_execution", self._steps),
            checks=(
                *read_section("believes", self._beliefs),
                *read_section("running", lambda node, path: self._observer_checks(node, path, is_running=True)),
                *read_section("stopped", lambda node, path: self._observer_checks(node, path, is_running=False)),
                *read_section("previews", self._preview_checks),
                *read_section("decided", self._outcomes),
                *read_section("expects", self._expectation_checks),
            ),
        )

    # Changes of the world

    def _alterations(self, node: YamlNode, steps: tuple[str, ...]) -> Iterator[Change]:
        for key, value in self.declared_entries(node, "handle", steps):
            if isinstance(value, MappingNode):
                reader = self._reader(value)
                attributes = {
                    name: read_anything(reader, attribute, *steps, key.text, name)
                    for name, (_, attribute) in value.entries.items()
                }
                yield Alteration(resource=key.text, attributes=attributes, place=self._place(key))

    def _agent_values(self, node: YamlNode, steps: tuple[str, ...]) -> Iterator[Change]:
        for key, value in self.declared_entries(node, "agent", steps):
            if isinstance(value, MappingNode):
                names = [name for name, variable in self._variables.items() if key.text in variable.sources]
                problem = f"agent '{key.text}' is not a source of"
                values = dict(self._values(value, names, problem, (*steps, key.text)))
                yield AgentValues(agent=key.text, values=values, place=self._place(key))
            elif not value.reported:
                yield AgentValues(agent=key.text, values=None, place=self._place(key))

    def _behaviours(self, node: YamlNode, steps: tuple[str, ...]) -> Iterator[Change]:
        problem = f"no observer of spec {shown(self._package.model.name)} runs"
        for key, value in self._known_entries(node, self._package.algorithms, problem, steps):
            value_steps = (*steps, key.text)
            if not isinstance(value, MappingNode):
                if not value.reported:
                    yield Behaviour(algorithm=key.text, place=self._place(key))
                continue
            reader = self._reader(value)
            takes_s = reader.duration_s("takes", 0.0, least="zero") if "takes" in value.entries else None
            yield Behaviour(
                algorithm=key.text,
                place=self._place(key),
                returns=self._returned_values(key.text, value.value("returns"), value_steps),
                takes_s=takes_s,
                evidence_s=self._evidence(reader, value.value("evidence"), value_steps),
                fault=self._fault(reader, key.text, value, value_steps),
            )

    def _overrides(self, node: YamlNode, steps: tuple[str, ...]) -> Iterator[Change]:
        for key, value in self.declared_entries(node, "context-variable", steps):
            if isinstance(value, MappingNode):
                yield self._override(key.text, value, (*steps, key.text))
            elif not value.reported:
                yield Clearing(variable=key.text)

    def _override(self, variable: str, node: MappingNode, steps: tuple[str, ...]) -> Overriding:
        reader, value_node, reason_node = self._reader(node), node.value("is"), node.value("reason")
        type_, reason = self._variables[variable].type, reader.text("reason", "")
        if reason_node is not None and not reason_node.reported and not reason.strip():
            reader.fail("wrong-type", "'reason' is empty", reason_node, "state why the operator overrides it", *steps)
        for_s = reader.duration_s("for", 0.0)
        if for_s > MAX_OVERRIDE_S:
            message, help_text = f"'for' is longer than {MAX_OVERRIDE_S / 3600:g} h", "override it again before it ends"
            reader.fail("duration", message, node.value("for") or node, help_text, *steps)
        return Overriding(
            variable=variable,
            value=None
            if value_node is None
            else read_value(reader, value_node, type_, *steps, "is", unknown_help=_UNKNOWN_OVERRIDE_HELP),
            for_s=for_s,
            reason=reason,
        )

    def _returned_values(
        self, algorithm: str, node: YamlNode | None, steps: tuple[str, ...]
    ) -> Mapping[str, Literal | None] | None:
        if not isinstance(node, MappingNode):
            return None
        types, reader = self._package.algorithms[algorithm].returns, self._reader(node)
        returned_values: dict[str, Literal | None] = {}
        for key, value in self._known_entries(node, types, f"'{algorithm}' returns no", (*steps, "returns")):
            is_absent = isinstance(value, ScalarNode) and value.data is None and not value.reported
            may_be_absent = is_absent and types[key.text].optional
            returned_values[key.text] = (
                None if may_be_absent else read_value(reader, value, types[key.text], *steps, key.text)
            )
        return returned_values

    def _evidence(self, reader: Reader, node: YamlNode | None, steps: tuple[str, ...]) -> tuple[float, float] | None:
        if node is None or node.reported:
            return None
        ends = node.items if isinstance(node, SequenceNode) else [node]
        durations = [parse_duration(end.text) if isinstance(end, ScalarNode) else None for end in ends]
        wrong_end = next(
            (end for end, end_s in zip(ends, durations, strict=True) if end_s is None or end_s == math.inf), None
        )
        instants = [end_s for end_s in durations if end_s is not None]
        if wrong_end is not None:
            reader.fail("duration", "'evidence' must be durations", wrong_end, "such as '0 s' or [0 s, 100 ms]", *steps)
            return None
        if instants[0] > instants[-1]:
            reader.fail("duration", "'evidence' ends before it begins", node, "write the earlier time first", *steps)
            return None
        return instants[0], instants[-1]

    def _fault(self, reader: Reader, algorithm: str, node: MappingNode, steps: tuple[str, ...]) -> Fault | None:
        garbage_node, returns = node.value("garbage"), self._package.algorithms[algorithm].returns
        fault_keys = [key for key in ("raises", "hangs", "garbage") if key in node.entries]
        if len(fault_keys) > 1:
            message = f"{list_names(fault_keys)}: a fault can have only one of these keys"
            reader.fail("misplaced-key", message, reader.origin.of(node.entries[fault_keys[1]][0]), "remove the others")
        if not fault_keys and "late" not in node.entries:
            if "jobs" in node.entries:
                place = reader.origin.of(node.entries["jobs"][0])
                message = "'jobs' belongs to a fault, but there is no fault"
                reader.fail("misplaced-key", message, place, "remove 'jobs'", *steps)
            return None
        return Fault(
            raises=reader.text("raises", "") if "raises" in node.entries else None,
            hangs="hangs" in node.entries,
            garbage=() if garbage_node is None else (read_garbage(reader, garbage_node, returns, *steps, "garbage"),),
            late_s=reader.duration_s("late", 0.0),
            jobs=reader.number("jobs", 0) or math.inf,
        )

    # Changes of loops

    def _loop_switches(self, node: YamlNode, steps: tuple[str, ...]) -> Iterator[Change]:
        for key, value in self.declared_entries(node, "loop", steps):
            if isinstance(value, ScalarNode) and not value.reported:
                yield LoopSwitch(loop=key.text, runs=value.text == _RUNS, place=self._place(key))

    def _leaf_behaviours(self, node: YamlNode, steps: tuple[str, ...]) -> Iterator[Change]:
        problem = f"no tree of spec {shown(self._package.model.name)} has a leaf"
        for key, value in self._known_entries(node, self._package.leaves, problem, steps):
            if isinstance(value, MappingNode):
                reader = self._reader(value)
                result = Result.FAILURE if reader.text("returns", "") == Result.FAILURE.value else Result.SUCCESS
                takes_s = reader.duration_s("takes", 0.0, least="zero")
                yield LeafBehaviour(leaf=key.text, result=result, takes_s=takes_s)
            elif not value.reported:
                yield LeafBehaviour(leaf=key.text, result=Result.RUNNING)

    # Steps of the main execution

    def _steps(self, node: YamlNode, steps: tuple[str, ...]) -> Iterator[Step]:
        for key, value in entries(node):
            value_steps = (*steps, key.text)
            verb = Verb(key.text)
            if verb is Verb.SET and isinstance(value, MappingNode):
                problem = f"{self._missing_prefix} context-variable"
                for name, content in self._values(value, self._variables, problem, value_steps):
                    yield Step(verb=verb, names=(name,), value=content, place=self._place(value.entries[name][0]))
            elif verb is Verb.DECIDE:
                yield from self._decisions(value, value_steps)
            elif isinstance(value, SequenceNode):
                yield self._step(verb, value, value_steps)

    def _step(self, verb: Verb, node: SequenceNode, steps: tuple[str, ...]) -> Step:
        noun = "skill" if verb in _SKILL_VERBS else "context-variable"
        names = tuple(name.text for name in self._declared_name_nodes(node, noun, steps))
        return Step(verb=verb, names=names, place=self._place(node))

    def _decisions(self, node: YamlNode, steps: tuple[str, ...]) -> Iterator[Step]:
        for key, value in self.declared_entries(node, "context-variable", steps):
            decision_arguments = self._decision_arguments(value, self._variables[key.text].type, steps)
            yield Step(
                verb=Verb.DECIDE, names=(key.text,), decision_arguments=decision_arguments, place=self._place(key)
            )

    def _decision_arguments(self, node: YamlNode, type_: ValueType, steps: tuple[str, ...]) -> DecisionArguments:
        if not isinstance(node, MappingNode):
            return DecisionArguments()
        reader = self._reader(node)
        otherwise, shadow = node.value("otherwise"), node.value("shadow")
        return DecisionArguments(
            otherwise=None if otherwise is None else read_value(reader, otherwise, type_, *steps, "otherwise"),
            max_age_s=reader.duration_s("max_age", math.inf, least="zero"),
            since_s=reader.duration_s("since", -math.inf, least="zero"),
            wait_up_to_s=reader.duration_s("wait_up_to", 0.0, least="zero"),
            shadow=shadow is not None and shadow.data is True,
        )

    # Checks

    def _beliefs(self, node: YamlNode, steps: tuple[str, ...]) -> Iterator[Check]:
        for key, value in self.declared_entries(node, "context-variable", steps):
            type_ = self._variables[key.text].type
            if isinstance(value, MappingNode):
                yield self._belief(key, value, type_, (*steps, key.text))
            else:
                help_text = f"write '{key.text}: {{unknown: {_ANY_REASON}}}'"
                reader = self._reader_of(key, value)
                content = read_value(reader, value, type_, *steps, key.text, unknown_help=help_text)
                yield Belief(variable=key.text, is_stated=True, value=content, place=self._place_of_value(key, value))

    def _belief(self, key: ScalarNode, node: MappingNode, type_: ValueType, steps: tuple[str, ...]) -> Belief:
        reader = self._reader(node)
        value_node, within_node = node.value("is"), node.value("within")
        reason_text = reader.text("unknown", "") if "unknown" in node.entries else None
        value_keys = [key_name for key_name in ("is", "within", "source") if key_name in node.entries]
        if reason_text is not None and value_keys:
            place = reader.origin.of(node.entries[value_keys[0]][0])
            message = f"'{value_keys[0]}' describes a value, but 'unknown' expects none"
            reader.fail("misplaced-key", message, place, f"remove '{value_keys[0]}' or 'unknown'")
        reason_by_text = {str(reason): reason for reason in Reason}
        return Belief(
            variable=key.text,
            place=self._place_of_value(key, node),
            is_unknown=reason_text is not None,
            reason=reason_by_text.get(reason_text or _ANY_REASON),
            is_stated=value_node is not None,
            value=None
            if value_node is None
            else read_value(
                reader, value_node, type_, *steps, "is", unknown_help=f"write 'unknown: {_ANY_REASON}' instead of 'is'"
            ),
            within=None if within_node is None else read_difference(reader, within_node, type_, *steps, "within"),
            source=reader.text("source", ""),
            because=reader.text("because", ""),
        )

    def _observer_checks(self, node: YamlNode, steps: tuple[str, ...], *, is_running: bool) -> Iterator[Check]:
        for name in self._declared_name_nodes(node, "observer", steps):
            yield RunningCheck(observer=name.text, is_running=is_running, place=self._place(name))

    def _outcomes(self, node: YamlNode, steps: tuple[str, ...]) -> Iterator[Check]:
        for key, value in self.declared_entries(node, "context-variable", steps):
            if isinstance(value, ScalarNode):
                yield Outcome(variable=key.text, expected_outcome=value.text, place=self._place(value))

    def _expectation_checks(self, node: YamlNode, steps: tuple[str, ...]) -> Iterator[Check]:
        expected_variables = {
            skill.name: tuple(dict.fromkeys(expectation.variable for expectation in skill.expects))
            for skill in self._package.model.skills
        }
        for key, value in self.declared_entries(node, "skill", steps):
            problem, skill_steps = f"skill '{key.text}' expects nothing of", (*steps, key.text)
            for variable, word in self._known_entries(value, expected_variables[key.text], problem, skill_steps):
                if isinstance(word, ScalarNode) and not word.reported:
                    outcome, place = ExpectationOutcome(word.text), self._place(word)
                    yield ExpectationCheck(
                        skill=key.text, variable=variable.text, expected_outcome=outcome, place=place
                    )

    def _preview_checks(self, node: YamlNode, steps: tuple[str, ...]) -> Iterator[Check]:
        for key, value in self.declared_entries(node, "skill", steps):
            outcome = value.value("is") if isinstance(value, MappingNode) else value
            because = self._reader(value).text("because", "") if isinstance(value, MappingNode) else ""
            if isinstance(outcome, ScalarNode):
                place = self._place_of_value(key, value)
                yield PreviewCheck(skill=key.text, expected_outcome=outcome.text, because=because, place=place)

    # Names

    def _values(
        self, node: MappingNode, names: Collection[str], problem: str, steps: tuple[str, ...]
    ) -> Iterator[tuple[str, Literal | None]]:
        for key, value in self._known_entries(node, names, problem, steps):
            type_ = self._variables[key.text].type
            yield key.text, read_value(self._reader(node), value, type_, *steps, key.text)

    def declared_entries(
        self, node: YamlNode | None, noun: str, steps: tuple[str, ...]
    ) -> Iterator[tuple[ScalarNode, YamlNode]]:
        """Yield the entries whose keys are names of the spec, such as its skills; report the others."""
        return self._known_entries(node, self._declared_names[noun], f"{self._missing_prefix} {noun}", steps)

    def _known_entries(
        self, node: YamlNode | None, names: Collection[str], problem: str, steps: tuple[str, ...]
    ) -> Iterator[tuple[ScalarNode, YamlNode]]:
        """Yield the entries whose keys are among `names`; report the others."""
        for key, value in entries(node):
            if key.text in names:
                yield key, value
            else:
                self._report_unknown("unknown-key", key, names, problem, steps)

    def _declared_name_nodes(self, node: YamlNode, noun: str, steps: tuple[str, ...]) -> Iterator[ScalarNode]:
        """Yield the items that are names of the spec, such as its skills; report the others."""
        names = self._declared_names[noun]
        for name_node in node.items if isinstance(node, SequenceNode) else ():
            if not isinstance(name_node, ScalarNode) or name_node.reported:
                continue
            if name_node.text in names:
                yield name_node
            else:
                self._report_unknown("unknown-value", name_node, names, f"{self._missing_prefix} {noun}", steps)

    def _report_unknown(
        self, rule: str, node: ScalarNode, names: Collection[str], problem: str, steps: tuple[str, ...]
    ) -> None:
        message = f"{problem} {shown(node.text)}"
        help_text = unknown_name_help(node.text, names, self._findings, steps[-1] if steps else "")
        path = self._subject.part(*steps, node.text)
        self._findings.add(rule, message, self._place(node), help=help_text, path=path)

    def _reader(self, node: MappingNode) -> Reader:
        return Reader(self._subject, node, self._findings)

    def _reader_of(self, key: ScalarNode, value: YamlNode) -> Reader:
        mapping_node = MappingNode(key.start, value.end, flow=True)
        mapping_node.put(key, value)
        return self._reader(mapping_node)

    def _place_of_value(self, key: ScalarNode, value: YamlNode) -> Any:
        return self._subject.origin.of_value(key, value)
