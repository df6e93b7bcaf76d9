"""Read one moment of a timeline: nodes -> changes, steps and checks, validated against the compiled spec."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from codra_dsl.integrations.testing.package import Package
from codra_dsl.integrations.testing.timeline import (
    Alteration,
    Asked,
    Behaviour,
    Belief,
    Change,
    Check,
    Fault,
    Moment,
    Outcome,
    Running,
    Saying,
    Step,
    Verb,
)
from codra_dsl.integrations.testing.values import read_anything, read_difference, read_value
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.yaml.findings import Findings, list_names
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, SequenceNode, YamlNode
from codra_dsl.language.load.yaml.origin import Subject
from codra_dsl.language.load.yaml.reader import Reader, entries
from codra_dsl.language.model import Literal
from codra_dsl.language.units import parse_duration
from codra_dsl.runtime import Reason
from codra_dsl.runtime.values.model import ValueType

_OF_SKILLS = (Verb.EXPECT, Verb.BEGIN, Verb.ACT, Verb.ACTED, Verb.END)
_ANY = "any"


class MomentReader:
    """Reads the moments of one file."""

    def __init__(self, package: Package, subject: Subject, findings: Findings) -> None:
        """Read moments for a compiled spec; findings refer to `subject`."""
        self._no = f"spec {shown(package.model.name)} has no"
        self._package = package
        self._subject = subject
        self._findings = findings
        self._place = subject.origin.of

    def read(self, at_s: float, key: ScalarNode, node: YamlNode, *steps: str) -> Moment:
        """Return the readable parts of a moment; `steps` is its path in the file."""
        sections = {name: value for name, (_, value) in node.entries.items()} if isinstance(node, MappingNode) else {}

        def of(name: str, read: Callable[..., Iterable[Any]]) -> tuple[Any, ...]:
            return tuple(read(sections[name], (*steps, name))) if name in sections else ()

        return Moment(
            at_s=at_s,
            place=self._place(key),
            changes=(
                *of("resources", self._alterations),
                *of("agents", self._sayings),
                *of("perception", self._behaviours),
            ),
            steps=of("main_execution", self._steps),
            checks=(
                *of("believes", self._beliefs),
                *of("running", lambda node, way: self._running(node, way, is_running=True)),
                *of("stopped", lambda node, way: self._running(node, way, is_running=False)),
                *of("decided", self._outcomes),
            ),
        )

    # Changes of the world

    def _alterations(self, node: YamlNode, steps: tuple[str, ...]) -> Iterator[Change]:
        for key, value in self._known(node, self._package.handles, f"{self._no} handle", steps):
            if isinstance(value, MappingNode):
                reader = self._reader(value)
                attributes = {
                    name: read_anything(reader, attribute, *steps, key.text, name)
                    for name, (_, attribute) in value.entries.items()
                }
                yield Alteration(resource=key.text, attributes=attributes, place=self._place(key))

    def _sayings(self, node: YamlNode, steps: tuple[str, ...]) -> Iterator[Change]:
        for key, value in self._known(node, self._package.agents, f"{self._no} agent", steps):
            if isinstance(value, MappingNode):
                names = [name for name, variable in self._package.variables.items() if key.text in variable.sources]
                problem = f"agent '{key.text}' is not a source of"
                yield Saying(agent=key.text, values=dict(self._values(value, names, problem, (*steps, key.text))))
            elif not value.reported:
                yield Saying(agent=key.text, values=None)

    def _behaviours(self, node: YamlNode, steps: tuple[str, ...]) -> Iterator[Change]:
        for key, value in self._known(
            node, self._package.algorithms, f"no observer of spec {shown(self._package.model.name)} runs", steps
        ):
            way = (*steps, key.text)
            if not isinstance(value, MappingNode):
                if not value.reported:
                    yield Behaviour(algorithm=key.text, place=self._place(key))
                continue
            reader = self._reader(value)
            takes_s = reader.duration_s("takes", 0.0, least="zero") if "takes" in value.entries else None
            yield Behaviour(
                algorithm=key.text,
                place=self._place(key),
                returns=self._returned(key.text, value.value("returns"), way),
                takes_s=takes_s,
                evidence_s=self._evidence(reader, value.value("evidence"), way),
                fault=self._fault(reader, value, way),
            )

    def _returned(
        self, algorithm: str, node: YamlNode | None, steps: tuple[str, ...]
    ) -> Mapping[str, Literal | None] | None:
        if not isinstance(node, MappingNode):
            return None
        declared = self._package.algorithms[algorithm].returns
        returned: dict[str, Literal | None] = {}
        for key, value in self._known(node, declared, f"'{algorithm}' returns no", (*steps, "returns")):
            is_absent = isinstance(value, ScalarNode) and value.data is None and not value.reported
            if is_absent and declared[key.text].optional:
                returned[key.text] = None
            else:
                returned[key.text] = read_value(self._reader(node), value, declared[key.text], *steps, key.text)
        return returned

    def _evidence(self, reader: Reader, node: YamlNode | None, steps: tuple[str, ...]) -> tuple[float, float] | None:
        if node is None or node.reported:
            return None
        ends = node.items if isinstance(node, SequenceNode) else [node]
        durations = [parse_duration(end.text) if isinstance(end, ScalarNode) else None for end in ends]
        wrong = next(
            (end for end, end_s in zip(ends, durations, strict=True) if end_s is None or end_s == math.inf), None
        )
        instants = [end_s for end_s in durations if end_s is not None]
        if wrong is not None:
            reader.fail("duration", "'evidence' must be durations", wrong, "such as '0 s' or [0 s, 100 ms]", *steps)
            return None
        if instants[0] > instants[-1]:
            reader.fail("duration", "'evidence' ends before it begins", node, "write the earlier first", *steps)
            return None
        return instants[0], instants[-1]

    def _fault(self, reader: Reader, node: MappingNode, steps: tuple[str, ...]) -> Fault | None:
        garbage = node.value("garbage")
        kinds = [key for key in ("raises", "hangs", "garbage") if key in node.entries]
        if len(kinds) > 1:
            message = f"{list_names(kinds)}: only one of them is possible"
            reader.fail("misplaced-key", message, reader.origin.of(node.entries[kinds[1]][0]), "remove the others")
        if not kinds and "late" not in node.entries:
            if "jobs" in node.entries:
                place = reader.origin.of(node.entries["jobs"][0])
                reader.fail("misplaced-key", "'jobs' belongs to a fault, and there is none", place, "remove it", *steps)
            return None
        return Fault(
            raises=reader.text("raises", "") if "raises" in node.entries else None,
            hangs="hangs" in node.entries,
            garbage=() if garbage is None else (garbage.data,),
            late_s=reader.duration_s("late", 0.0),
            jobs=reader.number("jobs", 0) or math.inf,
        )

    # Steps of the main execution

    def _steps(self, node: YamlNode, steps: tuple[str, ...]) -> Iterator[Step]:
        for key, value in entries(node):
            way = (*steps, key.text)
            verb = Verb(key.text)
            if verb is Verb.SET and isinstance(value, MappingNode):
                for name, content in self._values(value, self._package.variables, f"{self._no} context-variable", way):
                    yield Step(verb=verb, names=(name,), value=content, place=self._place(value.entries[name][0]))
            elif verb is Verb.DECIDE:
                yield from self._decisions(value, way)
            elif isinstance(value, SequenceNode):
                yield self._step(verb, value, way)

    def _step(self, verb: Verb, node: SequenceNode, steps: tuple[str, ...]) -> Step:
        skills = [skill.name for skill in self._package.model.skills]
        names, noun = (skills, "skill") if verb in _OF_SKILLS else (self._package.variables, "context-variable")
        known = tuple(name.text for name in self._listed(node, names, f"{self._no} {noun}", steps))
        return Step(verb=verb, names=known, place=self._place(node))

    def _decisions(self, node: YamlNode, steps: tuple[str, ...]) -> Iterator[Step]:
        for key, value in self._known(node, self._package.variables, f"{self._no} context-variable", steps):
            asked = Asked()
            if isinstance(value, MappingNode):
                asked = self._asked(self._reader(value), value, self._package.variables[key.text].type, steps)
            yield Step(verb=Verb.DECIDE, names=(key.text,), asked=asked, place=self._place(key))

    def _asked(self, reader: Reader, node: MappingNode, type_: ValueType, steps: tuple[str, ...]) -> Asked:
        otherwise, shadow = node.value("otherwise"), node.value("shadow")
        return Asked(
            otherwise=None if otherwise is None else read_value(reader, otherwise, type_, *steps, "otherwise"),
            max_age_s=reader.duration_s("max_age", math.inf, least="zero"),
            since_s=reader.duration_s("since", -math.inf, least="zero"),
            wait_up_to_s=reader.duration_s("wait_up_to", 0.0, least="zero"),
            shadow=shadow is not None and shadow.data is True,
        )

    # Checks

    def _beliefs(self, node: YamlNode, steps: tuple[str, ...]) -> Iterator[Check]:
        for key, value in self._known(node, self._package.variables, f"{self._no} context-variable", steps):
            type_ = self._package.variables[key.text].type
            if isinstance(value, MappingNode):
                yield self._belief(key, value, type_, (*steps, key.text))
            else:
                content = read_value(self._reader_of(key, value), value, type_, *steps, key.text)
                yield Belief(variable=key.text, is_stated=True, value=content, place=self._at(key, value))

    def _belief(self, key: ScalarNode, node: MappingNode, type_: ValueType, steps: tuple[str, ...]) -> Belief:
        reader = self._reader(node)
        stated, within = node.value("is"), node.value("within")
        unknown = reader.text("unknown", "") if "unknown" in node.entries else None
        about_value = [key_name for key_name in ("is", "within", "source") if key_name in node.entries]
        if unknown is not None and about_value:
            place = reader.origin.of(node.entries[about_value[0]][0])
            reader.fail("misplaced-key", f"'{about_value[0]}' is about a value, and it is unknown", place, "remove it")
        reasons = {str(reason): reason for reason in Reason}
        return Belief(
            variable=key.text,
            place=self._at(key, node),
            is_unknown=unknown is not None,
            reason=reasons.get(unknown or _ANY),
            is_stated=stated is not None,
            value=None if stated is None else read_value(reader, stated, type_, *steps, "is"),
            within=None if within is None else read_difference(reader, within, type_, *steps, "within"),
            source=reader.text("source", ""),
            because=reader.text("because", ""),
        )

    def _running(self, node: YamlNode, steps: tuple[str, ...], *, is_running: bool) -> Iterator[Check]:
        names = [observer.name for observer in self._package.model.observers]
        for name in self._listed(node, names, f"{self._no} observer", steps):
            yield Running(observer=name.text, is_running=is_running, place=self._place(name))

    def _outcomes(self, node: YamlNode, steps: tuple[str, ...]) -> Iterator[Check]:
        for key, value in self._known(node, self._package.variables, f"{self._no} context-variable", steps):
            if isinstance(value, ScalarNode):
                yield Outcome(variable=key.text, how=value.text, place=self._place(value))

    # Names

    def _values(
        self, node: MappingNode, names: Iterable[str], problem: str, steps: tuple[str, ...]
    ) -> Iterator[tuple[str, Literal | None]]:
        for key, value in self._known(node, names, problem, steps):
            type_ = self._package.variables[key.text].type
            yield key.text, read_value(self._reader(node), value, type_, *steps, key.text)

    def _known(
        self, node: YamlNode, names: Iterable[str], problem: str, steps: tuple[str, ...]
    ) -> Iterator[tuple[ScalarNode, YamlNode]]:
        """Yield the entries whose keys are among the names; report the others."""
        allowed = list(names)
        for key, value in entries(node):
            if key.text in allowed:
                yield key, value
            else:
                self._unknown("unknown-key", key, allowed, problem, steps)

    def _listed(
        self, node: YamlNode, names: Iterable[str], problem: str, steps: tuple[str, ...]
    ) -> Iterator[ScalarNode]:
        """Yield the items that are among the names; report the others."""
        allowed = list(names)
        for name_node in node.items if isinstance(node, SequenceNode) else ():
            if not isinstance(name_node, ScalarNode) or name_node.reported:
                continue
            if name_node.text in allowed:
                yield name_node
            else:
                self._unknown("unknown-value", name_node, allowed, problem, steps)

    def _unknown(self, rule: str, node: ScalarNode, names: Iterable[str], problem: str, steps: tuple[str, ...]) -> None:
        allowed = list(names)
        near = self._findings.nearest(node.text, allowed)
        there = f"there is {list_names(allowed)}" if allowed else "there is none"
        message = f"{problem} {shown(node.text)}"
        help = f"did you mean '{near}'?" if near else there
        path = self._subject.part(*steps, node.text)
        self._findings.add(rule, message, self._place(node), help=help, path=path)

    def _reader(self, node: MappingNode) -> Reader:
        return Reader(self._subject, node, self._findings)

    def _reader_of(self, key: ScalarNode, value: YamlNode) -> Reader:
        holder = MappingNode(key.start, value.end, flow=True)
        holder.put(key, value)
        return self._reader(holder)

    def _at(self, key: ScalarNode, value: YamlNode) -> Any:
        return self._subject.origin.of_value(key, value)
