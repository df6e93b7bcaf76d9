"""Whether what `call` names is there, and takes what it gets: modules of the project are read, never imported.

The runtime calls a perception function with keyword arguments only: what `with` gives, the handle of each resource
that it reads, the values of `given` variables, and `job`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from codra_dsl.diagnostics import Place, Related, replacing
from codra_dsl.expression.tokens import shown
from codra_dsl.load.findings import Findings, listed
from codra_dsl.load.modules import Missing, Module, Modules, Signature
from codra_dsl.model import Access, Algorithm

JOB = "job"
"""The argument that every perception function gets."""


@dataclass(frozen=True, slots=True)
class Declared:
    """What algorithms may name, and which of their keys could not be read."""

    resources: frozenset[str]
    context: frozenset[str]
    damaged_keys: Mapping[tuple[str, str], frozenset[str]]

    def gives_all(self, algorithm: Algorithm) -> bool:
        """Return whether it is known what an algorithm's function gets."""
        damaged = self.damaged_keys.get(("perception", algorithm.name), frozenset())
        if not damaged.isdisjoint({"with", "uses", "given"}):
            return False
        used = {usage.resource.name for usage in algorithm.uses}
        return used <= self.resources and {reference.name for reference in algorithm.given} <= self.context


def check_calls(algorithms: Iterable[Algorithm], declared: Declared, root: Path, findings: Findings) -> tuple[str, ...]:
    """Report calls that lead nowhere, and arguments that a function does not take or lacks.

    Returns:
        The files, relative to `root`, that decide what is found.
    """
    checker = _Checker(root, findings)
    by_call: dict[str, list[Algorithm]] = {}
    for algorithm in algorithms:
        if "call" not in declared.damaged_keys.get(("perception", algorithm.name), ()):
            by_call.setdefault(algorithm.call, []).append(algorithm)
    for call, callers in by_call.items():
        signature = checker.signature(call, callers)
        for caller in callers if signature is not None else ():
            if signature is not None and declared.gives_all(caller):
                checker.arguments(caller, signature)
    checker.report_modules()
    return tuple(checker.modules.consulted)


class _Checker:
    """Compares calls with the modules of a project."""

    def __init__(self, root: Path, findings: Findings) -> None:
        self.modules = Modules(root)
        self._findings = findings
        self._without_module: dict[str, tuple[str, list[Algorithm]]] = {}

    def signature(self, call: str, callers: list[Algorithm]) -> Signature | None:
        """Return what the function of a call takes, or None where that is not known or it is not there."""
        name, _, function = call.partition(":")
        module = self.modules.find(name)
        if isinstance(module, Missing):
            meant = self._meant(name, function, module)
            if meant is not None or module.at > 0:
                known = self._without_module.setdefault(name, (meant or "", []))
                known[1].extend(callers)
            return None
        if module is None:
            return None
        if function not in module.names:
            if not module.is_open:
                self._report_function(call, callers, module)
            return None
        signature = module.names[function]
        if signature is not None and signature.is_unfit:
            self._report_class(call, callers)
            return None
        return signature

    def report_modules(self) -> None:
        """Report the modules that are not there, each once."""
        for name, (meant, callers) in self._without_module.items():
            first, *others = callers
            message = f"there is no module {shown(name)} in this project, which algorithm '{first.name}' calls"
            way_out = f"did you mean '{meant}'?" if meant else "write it, or name the one where the function is"
            self._report(first, message, way_out, meant and f"{meant}:{first.call.partition(':')[2]}", others)

    def _report_function(self, call: str, callers: list[Algorithm], module: Module) -> None:
        name, _, function = call.partition(":")
        near = self._findings.nearest(function, module.names)
        has = f"it has {listed(module.functions)}" if module.functions else "it has none"
        way_out = f"did you mean '{near}'?" if near else has
        first, *others = callers
        message = f"module {shown(name)} has no function {shown(function)}, which algorithm '{first.name}' calls"
        self._report(first, message, way_out, near and f"{name}:{near}", others)

    def _report_class(self, call: str, callers: list[Algorithm]) -> None:
        name, _, function = call.partition(":")
        first, *others = callers
        message = (
            f"class {shown(function)} of module {shown(name)}, which algorithm '{first.name}' calls, cannot perceive"
        )
        self._report(first, message, "give it a method 'perceive', or name a function", None, others)

    def _report(
        self, first: Algorithm, message: str, way_out: str, meant: str | None, others: Iterable[Algorithm]
    ) -> None:
        place = _place(first, "call")
        related = [Related(f"also in algorithm '{each.name}'", _place(each, "call")) for each in others]
        fix = replacing(place, first.call, meant, safe=False) if meant else None
        path = f"perception.{first.name}.call"
        self._findings.add("call-not-found", message, place, help=way_out, path=path, related=related, fix=fix)

    def _meant(self, name: str, function: str, missing: Missing) -> str | None:
        """Return the module that is probably meant by a name that leads nowhere: one that has the function, if any."""
        steps = name.split(".")
        wrong, before, after = steps[missing.at], steps[: missing.at], steps[missing.at + 1 :]
        there = self.modules.near(missing.folder)
        near = self._findings.nearest(wrong, there)
        split = [[each, wrong[len(each) :]] for each in there if wrong.startswith(each) and len(each) < len(wrong)]
        for middle in (*([[near]] if near else []), *split):
            meant = ".".join((*before, *middle, *after))
            module = self.modules.find(meant)
            if isinstance(module, Module) and (function in module.names or module.is_open):
                return meant
        return ".".join((*before, near, *after)) if near and missing.at > 0 else None

    def arguments(self, algorithm: Algorithm, signature: Signature) -> None:
        """Report what a function does not take of what it gets, and what it needs and does not get."""
        given = _given(algorithm)
        missing = [name for name in signature.needed if name not in given or name not in signature.accepted]
        strange = [name for name in given if name not in signature.accepted and not signature.takes_any]
        strange = [name for name in strange if name not in missing]  # which it takes by its place only
        only = missing[0] if len(strange) == len(missing) == 1 and strange != [JOB] else None
        others: list[str] = []
        for name in strange:
            near = None if name == JOB else self._findings.nearest(name, missing)
            missing = [each for each in missing if each not in (near, only)]
            if near is not None:
                self._report_strange(algorithm, [name], f"did you mean '{near}'?", near)
            elif only is not None:
                self._report_strange(algorithm, [name], f"did you mean '{only}', which is missing?")
            elif name == JOB:
                self._report_strange(algorithm, [name], "add it: every perception function gets 'job'")
            else:
                others.append(name)
        if others:
            taken = sorted(signature.accepted)
            self._report_strange(algorithm, others, f"it takes {listed(taken)}" if taken else "it takes none")
        for name in missing:
            self._report_missing(algorithm, name)

    def _report_strange(self, algorithm: Algorithm, names: list[str], way_out: str, near: str | None = None) -> None:
        call, place = shown(algorithm.call), _place_of(algorithm, names[0])
        noun, which = ("argument", "which") if len(names) == 1 else ("arguments", "all of which")
        message = f"function {call} takes no {noun} {listed(names)}, {which} algorithm '{algorithm.name}' gives it"
        fix = replacing(place, names[0], near, safe=False) if near is not None else None
        path = f"perception.{algorithm.name}.call"
        self._findings.add("call-arguments", message, place, help=way_out, path=path, fix=fix)

    def _report_missing(self, algorithm: Algorithm, name: str) -> None:
        call = shown(algorithm.call)
        message = f"function {call} needs an argument {shown(name)} that algorithm '{algorithm.name}' does not give"
        way_out = "give it under 'with', 'uses' or 'given', or give it a default value"
        if name in _given(algorithm):
            way_out = "let it be taken by its name: arguments are given so only"
        path = f"perception.{algorithm.name}.call"
        self._findings.add("call-arguments", message, _place(algorithm, "call"), help=way_out, path=path)


def _place(algorithm: Algorithm, key: str) -> Place:
    return algorithm.places.get(key) or algorithm.places.get("call", algorithm.place)


def _given(algorithm: Algorithm) -> list[str]:
    """Return the names of the arguments that a function gets."""
    names = [name for name, _ in algorithm.parameters]
    names += [usage.resource.name for usage in algorithm.uses if usage.access is Access.READ]
    names += [reference.name for reference in algorithm.given]
    return [*names, JOB]


def _place_of(algorithm: Algorithm, argument: str) -> Place:
    """Return the place that says that a function gets an argument."""
    references = [usage.resource for usage in algorithm.uses] + list(algorithm.given)
    places = [reference.place for reference in references if reference.name == argument]
    is_literal = any(name == argument for name, _ in algorithm.parameters)
    return _place(algorithm, f"with.{argument}") if is_literal or not places else places[0]
