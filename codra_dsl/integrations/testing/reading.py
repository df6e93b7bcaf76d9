"""Read a file, and return its timeline or findings. The file is checked like a spec.

Classes and functions that the file names are neither imported nor run. Only the compiled spec of the timeline is
imported, for its names and types.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path

from codra_dsl.integrations.testing.moments import MomentReader
from codra_dsl.integrations.testing.package import FOLDER, Package, PackageError, load_package
from codra_dsl.integrations.testing.timeline import Behaviour, LoopSwitch, Moment, Story, Timeline, Verb
from codra_dsl.language.diagnostics import Diagnostic, has_errors, in_file_order
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.elements.handles import read_handle
from codra_dsl.language.load.schema.keys_and_values import explain
from codra_dsl.language.load.schema.schema import has_shape
from codra_dsl.language.load.yaml.compose import compose
from codra_dsl.language.load.yaml.findings import Findings, list_names
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, YamlNode
from codra_dsl.language.load.yaml.origin import Origin, Subject
from codra_dsl.language.load.yaml.reader import Reader, entries
from codra_dsl.language.load.yaml.source import AS_ON_DISK, Source, file_place, read
from codra_dsl.language.model import Handle
from codra_dsl.language.project import relative_path, root_of
from codra_dsl.language.units import duration_help, parse_duration

_SCHEMA_DEFINITION = "timeline"
_CALL_HELP = "write 'module:name', for example 'door_world:Camera'"


def read_timeline(
    path: Path, texts: Mapping[str, bytes] = AS_ON_DISK
) -> tuple[Timeline | None, Package | None, tuple[Diagnostic, ...]]:
    """Return the timeline of a file with its compiled spec, or findings if it is not a valid timeline.

    `texts` is a mapping from paths relative to the project's root to the contents of files that are not read from disk.
    """
    findings = Findings()
    root = root_of(path)
    source = read(path, relative_path(path, root), root, findings, texts)
    node = None if source is None else compose(source, findings)
    if source is None or not isinstance(node, MappingNode) or not node.entries:
        if not len(findings):
            help_text = "begin it with 'codra: 1' and 'timeline: NAME'"
            findings.add("not-a-spec", "the file holds no keys", file_place(relative_path(path, root)), help=help_text)
        return None, None, findings.all()
    timeline_and_package = _read(source, node, root, findings)
    ordered_findings = in_file_order(findings.all())
    return (
        (None, None, ordered_findings)
        if timeline_and_package is None or has_errors(ordered_findings)
        else (*timeline_and_package, ordered_findings)
    )


def _read(source: Source, node: MappingNode, root: Path, findings: Findings) -> tuple[Timeline, Package] | None:
    name = node.value("timeline")
    key = name if isinstance(name, ScalarNode) else next(iter(node.entries.values()))[0]
    subject = Subject(_SCHEMA_DEFINITION, key, Origin(source))
    if not has_shape(_SCHEMA_DEFINITION, node.data):
        explain(_SCHEMA_DEFINITION, node, subject, findings)
    name = node.value("timeline")
    if not isinstance(name, ScalarNode) or name.reported:
        return None
    try:
        package = load_package(root, name.text, Reader(subject, node, findings).text("folder", FOLDER))
    except PackageError as error:
        findings.add("unknown-value", error.message, subject.origin.of(name), help=error.help, path="timeline")
        return None
    return _TimelineReader(source, package, subject, node, findings).timeline(name.text), package


class _TimelineReader:
    """Reads a file that has the shape of a timeline."""

    def __init__(
        self, source: Source, package: Package, subject: Subject, node: MappingNode, findings: Findings
    ) -> None:
        self._source = source
        self._package = package
        self._subject = subject
        self._node = node
        self._findings = findings
        self._moments = MomentReader(package, subject, findings)

    def timeline(self, name: str) -> Timeline:
        """Return the complete timeline."""
        reader = Reader(self._subject, self._node, self._findings)
        return Timeline(
            source=self._source,
            spec=name,
            seed=reader.number("seed", 0),
            handles=tuple(self._handles()),
            repeat_intervals_s=dict(self._repeat_intervals()),
            stories=tuple(self._stories()),
        )

    def _handles(self) -> Iterator[Handle]:
        for key, reader in self._readers("resources", "handle"):
            handle = read_handle(reader, key.text, _CALL_HELP, "resources", key.text)
            if handle is not None:
                yield handle

    def _repeat_intervals(self) -> Iterator[tuple[str, float]]:
        for key, reader in self._readers("agents", "agent"):
            repeat_interval_s = reader.duration_s("every", 0.0)
            if repeat_interval_s > 0:
                yield key.text, repeat_interval_s

    def _readers(self, section: str, noun: str) -> Iterator[tuple[ScalarNode, Reader]]:
        for key, node in self._moments.declared_entries(self._node.value(section), noun, (section,)):
            if isinstance(node, MappingNode):
                yield key, Reader(self._subject, node, self._findings)

    def _stories(self) -> Iterator[Story]:
        start_entry = self._node.entries.get("start")
        first_moments = () if start_entry is None else (self._moments.read(0.0, *start_entry, "start"),)
        for key, node in entries(self._node.value("stories")):
            moments = (*first_moments, *self._moments_of(key.text, node))
            if not moments:
                continue
            story = Story(name=key.text, place=self._subject.origin.of(key), moments=moments)
            self._check_skills(story)
            self._check_behaviours(story)
            self._check_loops(story)
            yield story

    def _moments_of(self, story: str, node: YamlNode) -> Iterator[Moment]:
        last_instant_s, last_text = 0.0, ""
        for key, value in entries(node):
            at_s = parse_duration(key.text)
            place, path = self._subject.origin.of(key), f"stories.{story}.{key.text}"
            if at_s is None or not 0 <= at_s < math.inf:
                message = f"{shown(key.text)} is not an instant of a story"
                help_text = duration_help(key.text) if at_s is None else "write a duration since the beginning: '12 s'"
                self._findings.add("duration", message, place, help=help_text, path=path)
                at_s = last_instant_s
            elif at_s < last_instant_s or (last_text and at_s == last_instant_s):
                message = f"{shown(key.text)} is not later than {shown(last_text)}"
                self._findings.add("duration", message, place, help="write moments in order, each only once", path=path)
                at_s = last_instant_s
            last_instant_s, last_text = at_s, key.text
            yield self._moments.read(at_s, key, value, "stories", story, key.text)

    def _check_skills(self, story: Story) -> None:
        """Report skills that act or end without having begun, and skills that begin twice."""
        running_skills: set[str] = set()
        for step in (step for moment in story.moments for step in moment.steps):
            for name in step.names if step.verb in (Verb.BEGIN, Verb.ACT, Verb.ACTED, Verb.END) else ():
                if (name in running_skills) is (step.verb is Verb.BEGIN):
                    state, help_text = (
                        ("is already running", "end it first")
                        if name in running_skills
                        else ("is not running", "begin it first")
                    )
                    self._findings.add("misplaced-key", f"skill {shown(name)} {state}", step.place, help=help_text)
                if step.verb is Verb.BEGIN:
                    running_skills.add(name)
                elif step.verb is Verb.END:
                    running_skills.discard(name)

    def _check_loops(self, story: Story) -> None:
        """Report loops that stop without running, and running loops that start again."""
        running_loops: set[str] = set()
        for switch in (change for moment in story.moments for change in moment.changes):
            if not isinstance(switch, LoopSwitch):
                continue
            if (switch.loop in running_loops) is switch.runs:
                state, help_text = (
                    ("is already running", "stop it first") if switch.runs else ("is not running", "let it run first")
                )
                self._findings.add("misplaced-key", f"loop {shown(switch.loop)} {state}", switch.place, help=help_text)
            (running_loops.add if switch.runs else running_loops.discard)(switch.loop)

    def _check_behaviours(self, story: Story) -> None:
        """Report algorithms whose returned values are not stated."""
        returned_names_by_algorithm: dict[str, set[str]] = {}
        for behaviour in (
            change for moment in story.moments for change in moment.changes if isinstance(change, Behaviour)
        ):
            if behaviour.returns is not None:
                stated_names = returned_names_by_algorithm.setdefault(behaviour.algorithm, set())
                stated_names.update(behaviour.returns)
                declared_types = self._package.algorithms[behaviour.algorithm].returns
                missing_names = [
                    name for name, type_ in declared_types.items() if not type_.optional and name not in stated_names
                ]
                if missing_names:
                    message = f"{behaviour.algorithm!r} also returns {list_names(missing_names)}"
                    self._findings.add("missing-key", message, behaviour.place, help="add it under 'returns'")
            elif behaviour.algorithm not in returned_names_by_algorithm and (
                behaviour.takes_s is not None or behaviour.evidence_s is not None
            ):
                message = f"the results of {behaviour.algorithm!r} are not stated, so its own function is called"
                self._findings.add(
                    "misplaced-key", message, behaviour.place, help="add 'returns', or state only faults"
                )
