"""The assignment of elements to generated modules."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from codra_dsl.generation.build_plan.names import entry_names, module_name
from codra_dsl.generation.build_plan.values import Module, Tree
from codra_dsl.language.check.checked.spec import CheckedSpec
from codra_dsl.language.diagnostics import Place


@dataclass(slots=True)
class _Contents:
    """The contents of a module, while they are collected."""

    files: set[str] = field(default_factory=set)
    variables: list[str] = field(default_factory=list)
    trees: list[str] = field(default_factory=list)
    skills: list[str] = field(default_factory=list)


def assign_modules(checked: CheckedSpec, forest: tuple[Tree, ...]) -> tuple[Module, ...]:
    """Return one module for each spec file and each use of a template that has elements.

    Files and uses with the same module name share a module.

    A tree, with all its algorithms, is in the module in which its first algorithm is declared.

    The order of the modules is the order in which observers are ticked, so it must not depend on the name of the spec's
    file: a copy of a spec under another name gives the same events. Therefore the module of this file is sorted by the
    name of the spec, other modules by the name of the use or of the included file.
    """
    spec, contents = checked.spec, dict[str, _Contents]()
    taken_names = entry_names(spec)

    def declaring_module(section: str, name: str, place: Place) -> _Contents:
        """Return the module in which an element is declared."""
        module = contents.setdefault(module_name(spec.origins[section, name], taken_names), _Contents())
        module.files |= {place.span.file} if place.use is None else set()
        return module

    for variable in spec.context:
        declaring_module("context", variable.name, variable.place).variables.append(variable.name)
    for tree in forest:
        algorithm = tree.branches[0].algorithm.algorithm
        declaring_module("perception", algorithm.name, algorithm.place).trees.append(tree.name)
    for skill in spec.skills:
        declaring_module("skills", skill.name, skill.place).skills.append(skill.name)

    def sort_key(module_entry: tuple[str, _Contents]) -> tuple[str, bool, list[str]]:
        name, module = module_entry
        files, is_own = sorted(module.files), spec.file in module.files
        if is_own:
            return spec.name, False, files
        return Path(files[0]).stem.replace("-", "_") if files else name, True, files

    use_by_module = {module_name(use.instance, taken_names): use for use in spec.uses}
    return tuple(
        Module(
            name=name,
            files=tuple(sorted(module.files)),
            use=use_by_module.get(name),
            variables=tuple(module.variables),
            trees=tuple(module.trees),
            skills=tuple(module.skills),
        )
        for name, module in sorted(contents.items(), key=sort_key)
    )
