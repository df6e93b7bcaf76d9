"""Check that the function under `call` exists, and that it accepts the arguments that it gets.

Modules of the project are read, never imported.

The runtime calls a perception function with keyword arguments only: the arguments under `with`, the handle of each
resource that it reads, the values of `given` variables, and `job`. It makes the handle of a site with the arguments
under `with`, and with `clock` if there is a parameter of this name.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from codra_dsl.language.diagnostics import Place, Related, replacement_fix
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.load.called_modules import MissingModule, Module, ProjectModules, Signature
from codra_dsl.language.load.yaml.findings import Findings, list_names
from codra_dsl.language.model import Access, Algorithm, Handle

JOB = "job"
"""The argument that every perception function gets."""

CLOCK = "clock"
"""The argument with the clock, for classes and functions that make handles and have this parameter."""


@dataclass(frozen=True, slots=True)
class DeclaredNames:
    """The names that algorithms may use, and the keys that could not be read, as in `Spec.damaged_keys`."""

    resources: frozenset[str]
    context: frozenset[str]
    damaged_keys: Mapping[tuple[str, str], frozenset[str]]

    def has_call(self, algorithm: Algorithm) -> bool:
        """Return whether the call of an algorithm could be read."""
        return "call" not in self._damaged(algorithm)

    def has_all_arguments(self, algorithm: Algorithm) -> bool:
        """Return whether all arguments of an algorithm's function are known."""
        if not self._damaged(algorithm).isdisjoint({"with", "uses", "given"}):
            return False
        used_resources = {usage.resource.name for usage in algorithm.uses}
        return used_resources <= self.resources and {reference.name for reference in algorithm.given} <= self.context

    def _damaged(self, algorithm: Algorithm) -> frozenset[str]:
        return self.damaged_keys.get(("perception", algorithm.name), frozenset())


@dataclass(frozen=True, slots=True, kw_only=True)
class _Caller:
    """An element that calls a function or a class.

    Attributes:
        text: the element in messages.
        path: the path of the key `call`; `place` is the place of its value.
        arguments: the arguments that are given by name, each with its place; None if they are not all known.
        argument_keys: the keys under which arguments can be given, for help texts.
        is_maker: whether it makes a handle.
    """

    text: str
    call: str
    path: str
    place: Place
    arguments: Mapping[str, Place] | None
    argument_keys: str
    is_maker: bool = False


def _caller_of_algorithm(algorithm: Algorithm, declared_names: DeclaredNames) -> _Caller:
    place = algorithm.places.get("call", algorithm.place)
    arguments = {name: algorithm.places.get(f"with.{name}", place) for name, _ in algorithm.parameters}
    resources = (usage.resource for usage in algorithm.uses if usage.access is Access.READ)
    for reference in (*resources, *algorithm.given):
        arguments.setdefault(reference.name, reference.place)
    return _Caller(
        text=f"algorithm '{algorithm.name}'",
        call=algorithm.call,
        path=f"perception.{algorithm.name}.call",
        place=place,
        arguments={**arguments, JOB: place} if declared_names.has_all_arguments(algorithm) else None,
        argument_keys="'with', 'uses' or 'given'",
    )


def _caller_of_handle(handle: Handle) -> _Caller:
    names = (name for name, _ in handle.arguments)
    return _Caller(
        text=f"resource '{handle.resource}'",
        call=handle.call,
        path=f"resources.{handle.resource}.call",
        place=handle.place,
        arguments=dict(zip(names, handle.argument_places, strict=True)),
        argument_keys="'with'",
        is_maker=True,
    )


def check_calls(
    algorithms: Iterable[Algorithm],
    handles: Iterable[Handle],
    declared_names: DeclaredNames,
    root: Path,
    findings: Findings,
) -> tuple[str, ...]:
    """Report calls of missing functions, arguments that a function does not accept, and arguments that are missing.

    Returns:
        The files, relative to `root`, on which the result depends.
    """
    checker = _Checker(root, findings)
    callers_by_call: dict[tuple[str, bool], list[_Caller]] = {}
    callers = [
        _caller_of_algorithm(algorithm, declared_names)
        for algorithm in algorithms
        if declared_names.has_call(algorithm)
    ]
    for caller in (*callers, *map(_caller_of_handle, handles)):
        callers_by_call.setdefault((caller.call, caller.is_maker), []).append(caller)
    for callers in callers_by_call.values():
        signature = checker.signature(callers)
        for caller in callers if signature is not None else ():
            if signature is not None and caller.arguments is not None:
                checker.check_arguments(caller, caller.arguments, signature)
    checker.report_modules()
    return tuple(checker.modules.consulted_files)


class _Checker:
    """Compares calls with the modules of a project."""

    def __init__(self, root: Path, findings: Findings) -> None:
        self.modules = ProjectModules(root)
        self._findings = findings
        self._missing_modules: dict[str, tuple[str, list[_Caller]]] = {}

    def signature(self, callers: Sequence[_Caller]) -> Signature | None:
        """Return the signature of what callers call, or None if the signature is unknown or the function is missing."""
        name, _, function = callers[0].call.partition(":")
        function, _, attribute = function.partition(".") if callers[0].is_maker else (function, "", "")
        module = self.modules.find(name)
        if isinstance(module, MissingModule):
            suggestion = self._suggestion(name, function, module)
            if suggestion is not None or module.part_index > 0:
                entry = self._missing_modules.setdefault(name, (suggestion or "", []))
                entry[1].extend(callers)
            return None
        if module is None:
            return None
        if function not in module.names:
            if not module.is_open:
                self._report_function(callers, module)
            return None
        if callers[0].is_maker:
            return None if attribute else module.makers.get(function)
        signature = module.names[function]
        if signature is not None and signature.is_unfit:
            self._report_class(callers)
            return None
        return signature

    def report_modules(self) -> None:
        """Report each missing module once."""
        for name, (suggestion, callers) in self._missing_modules.items():
            first, *others = callers
            message = f"module {shown(name)}, which {first.text} calls, is not in this project"
            help_text = (
                f"did you mean '{suggestion}'?"
                if suggestion
                else "create this module, or use the name of the module that contains the function"
            )
            self._report(
                first, message, help_text, suggestion and f"{suggestion}:{first.call.partition(':')[2]}", others
            )

    def _report_function(self, callers: Sequence[_Caller], module: Module) -> None:
        name, _, function = callers[0].call.partition(":")
        suggestion = self._findings.nearest(function, module.names)
        functions_text = (
            f"the module has {list_names(module.functions)}" if module.functions else "the module has no functions"
        )
        help_text = f"did you mean '{suggestion}'?" if suggestion else functions_text
        first, *others = callers
        message = f"module {shown(name)} has no function {shown(function)}, but {first.text} calls it"
        self._report(first, message, help_text, suggestion and f"{name}:{suggestion}", others)

    def _report_class(self, callers: Sequence[_Caller]) -> None:
        first, *others = callers
        name, _, function = first.call.partition(":")
        message = f"class {shown(function)} of module {shown(name)}, which {first.text} calls, has no 'perceive'"
        self._report(first, message, "add a method 'perceive', or use the name of a function", None, others)

    def _report(
        self, first: _Caller, message: str, help_text: str, replacement: str | None, others: Iterable[_Caller]
    ) -> None:
        related = [Related(f"also in {caller.text}", caller.place) for caller in others]
        fix = replacement_fix(first.place, first.call, replacement, safe=False) if replacement else None
        self._findings.add(
            "call-not-found", message, first.place, help=help_text, path=first.path, related=related, fix=fix
        )

    def _suggestion(self, name: str, function: str, missing: MissingModule) -> str | None:
        """Return the module that an unknown name probably means, preferably one that has the function, or None."""
        name_parts = name.split(".")
        unknown_part, before, after = (
            name_parts[missing.part_index],
            name_parts[: missing.part_index],
            name_parts[missing.part_index + 1 :],
        )
        sibling_modules = self.modules.module_names(missing.folder, unknown_part)
        nearest_name = self._findings.nearest(unknown_part, sibling_modules)
        split_parts = [
            [prefix, unknown_part[len(prefix) :]]
            for prefix in sibling_modules
            if unknown_part.startswith(prefix) and len(prefix) < len(unknown_part)
        ]
        for replacement_parts in (*([[nearest_name]] if nearest_name else []), *split_parts):
            dotted_name = ".".join((*before, *replacement_parts, *after))
            module = self.modules.find(dotted_name)
            if isinstance(module, Module) and (function in module.names or module.is_open):
                return dotted_name
        return ".".join((*before, nearest_name, *after)) if nearest_name and missing.part_index > 0 else None

    def check_arguments(self, caller: _Caller, arguments: Mapping[str, Place], signature: Signature) -> None:
        """Report passed arguments that a function does not take, and required arguments that are not passed."""
        given_arguments = [*arguments]
        if caller.is_maker and CLOCK in signature.accepted_names:
            given_arguments.append(CLOCK)
        missing_arguments = [
            name
            for name in signature.required_names
            if name not in given_arguments or name not in signature.accepted_names
        ]
        unaccepted_arguments = [
            name for name in given_arguments if name not in signature.accepted_names and not signature.accepts_any_name
        ]
        # positional-only arguments are reported as missing
        unaccepted_arguments = [name for name in unaccepted_arguments if name not in missing_arguments]
        only_missing_argument = (
            missing_arguments[0]
            if len(unaccepted_arguments) == len(missing_arguments) == 1 and unaccepted_arguments != [JOB]
            else None
        )
        others: list[str] = []
        for name in unaccepted_arguments:
            similar_argument = None if name == JOB else self._findings.nearest(name, missing_arguments)
            missing_arguments = [
                argument for argument in missing_arguments if argument not in (similar_argument, only_missing_argument)
            ]
            if similar_argument is not None:
                self._report_unaccepted_arguments(
                    caller, arguments, [name], f"did you mean '{similar_argument}'?", similar_argument
                )
            elif only_missing_argument is not None:
                self._report_unaccepted_arguments(
                    caller, arguments, [name], f"did you mean '{only_missing_argument}', which is missing?"
                )
            elif name == JOB:
                self._report_unaccepted_arguments(
                    caller, arguments, [name], "add the parameter 'job': every perception function gets it"
                )
            else:
                others.append(name)
        if others:
            accepted_text = list_names(sorted(signature.accepted_names)) if signature.accepted_names else "no arguments"
            self._report_unaccepted_arguments(caller, arguments, others, f"the function takes {accepted_text}")
        for name in missing_arguments:
            self._report_missing(caller, arguments, name)

    def _report_unaccepted_arguments(
        self,
        caller: _Caller,
        arguments: Mapping[str, Place],
        names: list[str],
        help_text: str,
        replacement: str | None = None,
    ) -> None:
        place = arguments[names[0]]
        noun, pronoun = ("argument", "it") if len(names) == 1 else ("arguments", "them")
        message = (
            f"function {shown(caller.call)} does not take the {noun} {list_names(names)}, "
            f"but {caller.text} gives {pronoun}"
        )
        fix = replacement_fix(place, names[0], replacement, safe=False) if replacement is not None else None
        self._findings.add("call-arguments", message, place, help=help_text, path=caller.path, fix=fix)

    def _report_missing(self, caller: _Caller, arguments: Mapping[str, Place], name: str) -> None:
        message = f"function {shown(caller.call)} needs an argument {shown(name)}, but {caller.text} does not give it"
        help_text = f"add {shown(name)} under {caller.argument_keys}, or give the parameter a default value"
        if name in arguments:
            help_text = "make it a keyword argument: arguments are passed only by name"
        self._findings.add("call-arguments", message, caller.place, help=help_text, path=caller.path)
