"""Check that the function under `call` exists, and that it accepts the arguments that it gets.

Modules of the project are read, never imported.

The runtime calls a perception function with keyword arguments only: the arguments under `with`, the handle of each
resource that it reads, the values of `given` variables, and `job`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from codra_dsl.language.diagnostics import Place, Related, replacement_fix
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.load.called_modules import MissingModule, Module, ProjectModules, Signature
from codra_dsl.language.load.yaml.findings import Findings, list_names
from codra_dsl.language.model import Access, Algorithm

JOB = "job"
"""The argument that every perception function gets."""


@dataclass(frozen=True, slots=True)
class DeclaredNames:
    """The names that algorithms may use, and the keys that could not be read, as in `Spec.damaged_keys`."""

    resources: frozenset[str]
    context: frozenset[str]
    damaged_keys: Mapping[tuple[str, str], frozenset[str]]

    def has_all_arguments(self, algorithm: Algorithm) -> bool:
        """Return whether all arguments of an algorithm's function are known."""
        damaged = self.damaged_keys.get(("perception", algorithm.name), frozenset())
        if not damaged.isdisjoint({"with", "uses", "given"}):
            return False
        used_resources = {usage.resource.name for usage in algorithm.uses}
        return used_resources <= self.resources and {reference.name for reference in algorithm.given} <= self.context


def check_calls(
    algorithms: Iterable[Algorithm], declared_names: DeclaredNames, root: Path, findings: Findings
) -> tuple[str, ...]:
    """Report calls of missing functions, arguments that a function does not accept, and arguments that are missing.

    Returns:
        The files, relative to `root`, on which the result depends.
    """
    checker = _Checker(root, findings)
    algorithms_by_call: dict[str, list[Algorithm]] = {}
    for algorithm in algorithms:
        if "call" not in declared_names.damaged_keys.get(("perception", algorithm.name), ()):
            algorithms_by_call.setdefault(algorithm.call, []).append(algorithm)
    for call, callers in algorithms_by_call.items():
        signature = checker.signature(call, callers)
        for caller in callers if signature is not None else ():
            if signature is not None and declared_names.has_all_arguments(caller):
                checker.check_arguments(caller, signature)
    checker.report_modules()
    return tuple(checker.modules.consulted_files)


class _Checker:
    """Compares calls with the modules of a project."""

    def __init__(self, root: Path, findings: Findings) -> None:
        self.modules = ProjectModules(root)
        self._findings = findings
        self._missing_modules: dict[str, tuple[str, list[Algorithm]]] = {}

    def signature(self, call: str, callers: list[Algorithm]) -> Signature | None:
        """Return the signature of a called function, or None if the signature is unknown or the function is missing."""
        name, _, function = call.partition(":")
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
                self._report_function(call, callers, module)
            return None
        signature = module.names[function]
        if signature is not None and signature.is_unfit:
            self._report_class(call, callers)
            return None
        return signature

    def report_modules(self) -> None:
        """Report each missing module once."""
        for name, (suggestion, callers) in self._missing_modules.items():
            first, *others = callers
            message = f"module {shown(name)}, which algorithm '{first.name}' calls, is not in this project"
            help_text = (
                f"did you mean '{suggestion}'?"
                if suggestion
                else "create this module, or use the name of the module that contains the function"
            )
            self._report(
                first, message, help_text, suggestion and f"{suggestion}:{first.call.partition(':')[2]}", others
            )

    def _report_function(self, call: str, callers: list[Algorithm], module: Module) -> None:
        name, _, function = call.partition(":")
        suggestion = self._findings.nearest(function, module.names)
        functions_text = (
            f"the module has {list_names(module.functions)}" if module.functions else "the module has no functions"
        )
        help_text = f"did you mean '{suggestion}'?" if suggestion else functions_text
        first, *others = callers
        message = f"module {shown(name)} has no function {shown(function)}, but algorithm '{first.name}' calls it"
        self._report(first, message, help_text, suggestion and f"{name}:{suggestion}", others)

    def _report_class(self, call: str, callers: list[Algorithm]) -> None:
        name, _, function = call.partition(":")
        first, *others = callers
        message = (
            f"class {shown(function)} of module {shown(name)}, which algorithm '{first.name}' calls, has no 'perceive'"
        )
        self._report(first, message, "add a method 'perceive', or use the name of a function", None, others)

    def _report(
        self, first: Algorithm, message: str, help_text: str, replacement: str | None, others: Iterable[Algorithm]
    ) -> None:
        place = _place(first, "call")
        related = [Related(f"also in algorithm '{algorithm.name}'", _place(algorithm, "call")) for algorithm in others]
        fix = replacement_fix(place, first.call, replacement, safe=False) if replacement else None
        path = f"perception.{first.name}.call"
        self._findings.add("call-not-found", message, place, help=help_text, path=path, related=related, fix=fix)

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

    def check_arguments(self, algorithm: Algorithm, signature: Signature) -> None:
        """Report passed arguments that a function does not take, and required arguments that are not passed."""
        given_arguments = _argument_names(algorithm)
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
                    algorithm, [name], f"did you mean '{similar_argument}'?", similar_argument
                )
            elif only_missing_argument is not None:
                self._report_unaccepted_arguments(
                    algorithm, [name], f"did you mean '{only_missing_argument}', which is missing?"
                )
            elif name == JOB:
                self._report_unaccepted_arguments(
                    algorithm, [name], "add the parameter 'job': every perception function gets it"
                )
            else:
                others.append(name)
        if others:
            accepted_text = list_names(sorted(signature.accepted_names)) if signature.accepted_names else "no arguments"
            self._report_unaccepted_arguments(algorithm, others, f"the function takes {accepted_text}")
        for name in missing_arguments:
            self._report_missing(algorithm, name)

    def _report_unaccepted_arguments(
        self, algorithm: Algorithm, names: list[str], help_text: str, replacement: str | None = None
    ) -> None:
        call, place = shown(algorithm.call), _place_of_argument(algorithm, names[0])
        noun, pronoun = ("argument", "it") if len(names) == 1 else ("arguments", "them")
        fault_text = f"function {call} does not take the {noun} {list_names(names)}"
        message = f"{fault_text}, but algorithm '{algorithm.name}' gives {pronoun}"
        fix = replacement_fix(place, names[0], replacement, safe=False) if replacement is not None else None
        path = f"perception.{algorithm.name}.call"
        self._findings.add("call-arguments", message, place, help=help_text, path=path, fix=fix)

    def _report_missing(self, algorithm: Algorithm, name: str) -> None:
        call = shown(algorithm.call)
        message = f"function {call} needs an argument {shown(name)}, but algorithm '{algorithm.name}' does not give it"
        help_text = f"add {shown(name)} under 'with', 'uses' or 'given', or give the parameter a default value"
        if name in _argument_names(algorithm):
            help_text = "make it a keyword argument: arguments are passed only by name"
        path = f"perception.{algorithm.name}.call"
        self._findings.add("call-arguments", message, _place(algorithm, "call"), help=help_text, path=path)


def _place(algorithm: Algorithm, key: str) -> Place:
    return algorithm.places.get(key) or algorithm.places.get("call", algorithm.place)


def _argument_names(algorithm: Algorithm) -> list[str]:
    """Return the names of the arguments that a function gets."""
    names = [name for name, _ in algorithm.parameters]
    names += [usage.resource.name for usage in algorithm.uses if usage.access is Access.READ]
    names += [reference.name for reference in algorithm.given]
    return [*names, JOB]


def _place_of_argument(algorithm: Algorithm, argument: str) -> Place:
    """Return the place at which an algorithm gives an argument."""
    references = [usage.resource for usage in algorithm.uses] + list(algorithm.given)
    places = [reference.place for reference in references if reference.name == argument]
    is_literal = any(name == argument for name, _ in algorithm.parameters)
    return _place(algorithm, f"with.{argument}") if is_literal or not places else places[0]
