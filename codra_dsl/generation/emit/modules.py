"""One generated module: the algorithms, trees, variables and skills of a spec file or of a use of a template."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from codra_dsl.generation.build_plan import BuildPlan, Module, Tree
from codra_dsl.generation.emit.declarations import algorithm, observer, skill, variable
from codra_dsl.generation.emit.imports import Imports
from codra_dsl.generation.emit.layout import Expression, laid_out, spread_tuple
from codra_dsl.generation.emit.literals import prose
from codra_dsl.generation.emit.rendering import made_by, render
from codra_dsl.generation.emit.trees import tree_text
from codra_dsl.language.model import Skill


def module_texts(plan: BuildPlan) -> Iterator[tuple[str, str]]:
    """Yield the path and text of each generated module."""
    forest = {tree.name: tree for tree in plan.forest}
    skills = {declared.name: declared for declared in plan.checked.spec.skills}
    for module in plan.modules:
        trees = [forest[name] for name in module.trees]
        yield f"{module.name}.py", _text(plan, module, trees, [skills[name] for name in module.skills])


def _text(plan: BuildPlan, module: Module, trees: list[Tree], skills: list[Skill]) -> str:
    imports = Imports()
    imports.use("VariableModel", "ObserverModel", "SkillModel")
    variables = (plan.checked.variables[name] for name in module.variables)
    branches = (branch for tree in trees for branch in tree.branches)
    of_skill, poses = plan.checked.expectations, plan.checked.poses
    texts = {
        "algorithms": [f"{branch.constant} = {laid_out(algorithm(branch, imports))}" for branch in branches],
        "trees": [tree_text(tree, imports) for tree in trees],
        "variables": _listed(
            "VARIABLES", "VariableModel", (variable(declared, poses, imports) for declared in variables)
        ),
        "observers": _listed("OBSERVERS", "ObserverModel", (observer(tree, imports) for tree in trees)),
        "skills": _listed(
            "SKILLS", "SkillModel", (skill(declared, of_skill.get(declared.name, ()), imports) for declared in skills)
        ),
    }
    return render("module.py.j2", title=_title(module), made_by=made_by(plan), imports=imports.lines(), **texts)


def _listed(name: str, kind: str, declarations: Iterable[Expression]) -> str:
    """Return a statement with declarations, one a line."""
    before = f"{name}: tuple[{kind}, ...] = "
    return before + laid_out(spread_tuple(declarations), before=len(before))


def _title(module: Module) -> str:
    """Return a one-line description of the module's contents."""
    use = [] if module.use is None else [f"'{module.use.instance}' (template '{module.use.template}')"]
    named = " and ".join([*use, *map(prose, module.files)])
    return f"{'Observers' if module.trees else 'Context'} of {named}."
