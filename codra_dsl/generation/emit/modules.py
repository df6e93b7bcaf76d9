"""Write generated modules: each has the algorithms, trees, variables and skills of spec files or a template's use."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from codra_dsl.generation.build_plan import BuildPlan, Module, Tree
from codra_dsl.generation.emit.declarations import (
    algorithm_declaration,
    observer_declaration,
    skill_declaration,
    variable_declaration,
)
from codra_dsl.generation.emit.imports import Imports
from codra_dsl.generation.emit.layout import Expression, lay_out, spread_tuple
from codra_dsl.generation.emit.literals import prose
from codra_dsl.generation.emit.rendering import made_by_line, render
from codra_dsl.generation.emit.trees import tree_text
from codra_dsl.language.model import Skill


def module_texts(plan: BuildPlan) -> Iterator[tuple[str, str]]:
    """Yield the path and text of each generated module."""
    forest = {tree.name: tree for tree in plan.forest}
    skills = {declared_skill.name: declared_skill for declared_skill in plan.checked.spec.skills}
    for module in plan.modules:
        trees = [forest[name] for name in module.trees]
        yield f"{module.name}.py", _module_text(plan, module, trees, [skills[name] for name in module.skills])


def _module_text(plan: BuildPlan, module: Module, trees: list[Tree], skills: list[Skill]) -> str:
    imports = Imports()
    imports.use("VariableModel", "ObserverModel", "SkillModel")
    variables = (plan.checked.variables[name] for name in module.variables)
    branches = (branch for tree in trees for branch in tree.branches)
    expectations, computed = plan.checked.expectations, plan.checked.expressions_of_variables
    previews = plan.checked.previews
    texts = {
        "algorithms": [f"{branch.constant} = {lay_out(algorithm_declaration(branch, imports))}" for branch in branches],
        "trees": [tree_text(tree, imports) for tree in trees],
        "variables": _tuple_statement(
            "VARIABLES",
            "VariableModel",
            (variable_declaration(declared_variable, computed, imports) for declared_variable in variables),
        ),
        "observers": _tuple_statement(
            "OBSERVERS", "ObserverModel", (observer_declaration(tree, imports) for tree in trees)
        ),
        "skills": _tuple_statement(
            "SKILLS",
            "SkillModel",
            (
                skill_declaration(
                    declared_skill,
                    previews.get(declared_skill.name, ()),
                    expectations.get(declared_skill.name, ()),
                    imports,
                )
                for declared_skill in skills
            ),
        ),
    }
    return render("module.py.j2", title=_title(module), made_by=made_by_line(plan), imports=imports.lines(), **texts)


def _tuple_statement(name: str, kind: str, declarations: Iterable[Expression]) -> str:
    """Return the statement that assigns a tuple of declarations to a name, with one declaration per line."""
    before = f"{name}: tuple[{kind}, ...] = "
    return before + lay_out(spread_tuple(declarations), before=len(before))


def _title(module: Module) -> str:
    """Return a one-line description of the module's contents."""
    use = [] if module.use is None else [f"'{module.use.instance}' (template '{module.use.template}')"]
    sources_text = " and ".join([*use, *map(prose, module.files)])
    return f"{'Observers' if module.trees else 'Context'} of {sources_text}."
