"""Names of specs against the names that generated code uses: no name hides another, whatever a spec declares."""

from __future__ import annotations

import ast
import builtins
import keyword
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path

import pytest

from codra_dsl.compiler import plan_paths, plan_text
from codra_dsl.generation.algorithm2 import plan
from codra_dsl.generation.build_plan import BuildPlan
from codra_dsl.generation.build_plan.names import ENTRY_NAMES, MODULE_NAMES, camel_case, entry_names
from codra_dsl.generation.emit import emit
from codra_dsl.integrations.inspection.loading import load_start
from codra_dsl.language.diagnostics import Diagnostic, Severity
from codra_dsl.language.expression import is_identifier
from codra_dsl.runtime import SimClock, generated_api
from tests.generation.emit.test_emit import rich
from tests.test_generated_api import GATE_SPEC

ROOT = Path(__file__).parents[2]
VALID_CASES = ROOT / "tests/cases/valid"
TREE = '<root BTCPP_format="4"><BehaviorTree ID="Main"><AlwaysSuccess/></BehaviorTree></root>'
EVERYTHING = """
context:
  near: {type: float, unit: m, range: [0, 9], source: robot, terms: {close: ramp 1 0}}
agents: {robot: {}}
knowledge: {nodes: {base: place}}
metrics: {calm: {worse: low, terms: {low: ramp 1 0}, rules: [if near is close then low]}}
loops: {watch: {analyse: [calm]}}
"""
OF_MODULES = {"knowledge", "mape", "metric_engine", "action_engine", "tree_mission", "main_tree", "generated_api"}
ENGINE = ("infer", "infer_bounds")
"""The functions of fuzzy engines, which assign their variables more than once."""
OF_ENGINES = {"infer", "infer_bounds", "previous", "x", "y", "INPUTS", "OUTPUTS", "RANGES", "RULES", "annotations"}
OF_OTHERS = {
    "KNOWLEDGE",
    "MAPE",
    "TREES",
    "MAIN",
    "ACTIONS",
    "loops",
    "codra",
    "robot",
    "clock",
    "it",
    "self",
    "AgentName",
}


def names_in_use() -> list[str]:
    """Return all names that generated code can use, and names that differ from these by an underscore at the end.

    The names are identifiers of the language, and no two of them differ only by case.
    """
    own = {*generated_api.__all__, *MODULE_NAMES, *ENTRY_NAMES, *OF_MODULES, *OF_ENGINES, *OF_OTHERS}
    with_underscores = {*own, *(f"{name}_" for name in own)}
    python = {*dir(builtins), *keyword.softkwlist, *(word.title() for word in keyword.kwlist)}
    return list(
        {name.casefold(): name for name in sorted({*with_underscores, *python}) if is_identifier(name)}.values()
    )


NAMES = names_in_use()


def bindings(statements: Iterable[ast.stmt]) -> Iterator[str]:
    """Yield each name that statements bind in their own scope; of `if`, only the first branch counts."""
    for statement in statements:
        match statement:
            case ast.Import(names=names) | ast.ImportFrom(names=names):
                yield from (alias.asname or alias.name for alias in names)
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                yield name
            case ast.If(body=body):
                yield from bindings(body)
            case ast.Assign() | ast.AnnAssign():
                targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
                yield from (target.id for target in targets if isinstance(target, ast.Name))


def clashes(text: str) -> list[str]:
    """Return the names that a module binds twice, and the names of imports and builtins that it hides."""
    module = ast.parse(text)
    of_module = list(bindings(module.body))
    imported = set(bindings(node for node in module.body if isinstance(node, ast.Import | ast.ImportFrom)))
    of_functions: list[str] = []
    for function in (node for node in module.body if isinstance(node, ast.FunctionDef) and node.name not in ENGINE):
        counts = Counter([*(argument.arg for argument in function.args.args), *bindings(function.body)])
        of_functions += [name for name, count in counts.items() if count > 1 or name in imported]
    hidden_builtins = [name for name in of_module if name in dir(builtins) and name.islower()]
    return [*(name for name, count in Counter(of_module).items() if count > 1), *of_functions, *hidden_builtins]


def of_algorithms() -> str:
    """Every second algorithm has an observer; the others are alternatives in tens. All values are debounced."""
    variable_by_name = {name: f"s{number // 20}" if number % 2 else f"v{number}" for number, name in enumerate(NAMES)}
    variables = dict.fromkeys(variable_by_name.values())
    lines = ["context:", *(f"  {variable}: {{type: bool, valid_for: 1 h}}" for variable in variables), "perception:"]
    for number, (name, variable) in enumerate(variable_by_name.items()):
        settings = f"call: math:sqrt, rank: {number + 1}, returns: {{seen: {{type: bool}}}}"
        lines.append(f"  {name}: {{{settings}, identifies: {{{variable}: {{enter: seen, confirm: 2 of 3}}}}}}")
    return "\n".join([*lines, f"skills: {{act: {{preview: [{', '.join(variables)}]}}}}\n"])


def of_variables_and_skills() -> str:
    lines = ["context:", "  here: {type: bool, source: main_execution}"]
    for number, name in enumerate(NAMES):
        lines.append(f"  {name}: {{type: enum, values: [{name}, m{number}], source: main_execution}}")
    lines += ["resources:", *(f"  {name}: {{}}" for name in NAMES)]
    lines += ["skills:", *(f"  {name}: {{preview: [here]}}" for name in NAMES)]
    return "\n".join(lines) + "\n"


def of_agents_and_knowledge() -> str:
    names = [name for name in NAMES if name not in ("observer", "task")]
    agents = "".join(f"  {name}: {{}}\n" for name in names)
    types = "".join(f"    {name}: {{attributes: {{{name}: {{type: int, source: {name}}}}}}}\n" for name in names)
    nodes = "".join(f"    {name}: {name}\n" for name in names)
    edges = "".join(f"    {name}: {{from: value, to: [text], source: {name}}}\n" for name in names)
    return f"agents:\n{agents}knowledge:\n  types:\n{types}  nodes:\n{nodes}  edges:\n{edges}"


def of_uses() -> str:
    template = "templates: {door: {context: {$(instance)_open: {type: bool, source: main_execution}}}}\n"
    return f"{template}use:\n" + "".join(f"  {name}: {{template: door}}\n" for name in NAMES)


def of_loops() -> str:
    """The names are those of variables, metrics, actions and trees in turn. Terms have the names of other elements."""
    names = [name for name in NAMES if name != "any"]  # a keyword of rules
    inputs, metrics, actions, trees = (names[number:400:4] for number in range(4))
    lines = ["context:"]
    for variable, term in zip(inputs, trees, strict=True):
        terms = f"terms: {{{term}: ramp 0 1}}"
        lines.append(f"  {variable}: {{type: float, range: [0, 1], source: main_execution, {terms}}}")
    for section, read, written, results in (("metrics", inputs, metrics, trees), ("actions", metrics, actions, inputs)):
        lines.append(f"{section}:")
        for variable, term, output, result in zip(read, trees, written, results, strict=True):
            rule = f"if {variable} is {term} then {result}"
            worse = "worse: low, " if section == "metrics" else ""
            lines.append(f"  {output}: {{{worse}terms: {{{result}: ramp 0 1}}, rules: [{rule}]}}")
    lines += ["trees:", *(f"  {tree}: {{file: tree.xml, leaves: {{}}}}" for tree in trees)]
    lines += [f"loops: {{first: {{analyse: [{', '.join(metrics)}], execute: [{', '.join(trees)}]}}}}\n"]
    return "\n".join(lines)


def package_of(declarations: str, folder: Path) -> Mapping[str, str]:
    """Return the files of the package of a spec without errors."""
    (folder / "specs").mkdir()
    (folder / "specs/tree.xml").write_text(TREE, encoding="utf-8")
    planned = plan_text(f"codra: 1\nname: hostile\n{declarations}", "specs/hostile.yaml", folder)
    errors = [finding for finding in planned.diagnostics if finding.rule.severity is Severity.ERROR]
    assert not errors, errors[:5]
    return emit(planned.plans[0])


@pytest.mark.parametrize(
    "declarations", [of_algorithms, of_variables_and_skills, of_agents_and_knowledge, of_uses, of_loops]
)
def test_elements_with_the_names_of_generated_code_hide_no_name(
    declarations: Callable[[], str], tmp_path: Path
) -> None:
    files = package_of(declarations(), tmp_path)

    assert len({path.casefold() for path in files}) == len(files)
    assert {path: names for path, text in files.items() if path.endswith(".py") and (names := clashes(text))} == {}
    start = load_start(files, "hostile", tmp_path / "generated")
    with start(clock=SimClock(), resources={}) as codra:
        assert type(codra).__name__ == "Hostile"


# The class of a spec


def findings_of_name(name: str) -> tuple[Diagnostic, ...]:
    planned = plan_text(f"codra: 1\nname: {name}{EVERYTHING}", "specs/hostile.yaml", ROOT)
    assert bool(planned.plans) is not any(finding.rule.severity is Severity.ERROR for finding in planned.diagnostics)
    return tuple(finding for finding in planned.diagnostics if finding.path == "name")


@pytest.mark.parametrize(
    "name",
    ["Mape", "mape", "MAPE", "Leaves", "KNOWLEDGE", "agent", "robot_handle", "clock_", "none"],
)
def test_a_spec_whose_class_would_hide_a_name_is_reported_at_its_name(name: str) -> None:
    (finding,) = findings_of_name(name)

    assert (finding.rule.name, finding.rule.severity) == ("reserved-name", Severity.ERROR)
    assert (finding.place.span.line, finding.place.span.column) == (2, 7)
    assert f"'{camel_case(name)}'" in finding.message
    (suggested_name,) = re.findall("such as '(.*)'", finding.help)
    assert findings_of_name(suggested_name) == ()


@pytest.mark.parametrize("name", ["node", "edge", "loops", "knowledge", "kitchen", "start", "print", "exception"])
def test_a_spec_whose_class_hides_no_name_is_not_reported(name: str) -> None:
    assert findings_of_name(name) == ()


def test_without_loops_and_knowledge_their_names_are_free() -> None:
    for name in ("mape", "leaves", "agent"):
        planned = plan_text(f"codra: 1\nname: {name}\ncontext: {{}}\n", "specs/free.yaml", ROOT)

        assert [build_plan.class_name for build_plan in planned.plans] == [camel_case(name)]


# The reserved names


def plans_of_all_constructs() -> Iterator[BuildPlan]:
    """Yield plans of specs that together have every form of output."""
    yield plan(rich())
    yield from plan_text(GATE_SPEC, "specs/gate.yaml", ROOT).plans
    yield from plan_paths([ROOT / "specs"], ROOT).plans
    for name in ("conditions.yaml", "knowledge-everything.yaml", "poses.yaml", "loops-everything/spec.yaml"):
        yield from plan_paths([VALID_CASES / name], VALID_CASES).plans


def own_bindings(text: str) -> set[str]:
    """Return the names that a module imports from other packages, and its constants that are in every package."""
    module = ast.parse(text)
    imports = (node for node in module.body if isinstance(node, ast.Import | ast.ImportFrom))
    names = bindings(node for node in imports if isinstance(node, ast.Import) or not node.level)
    return {*names} | {"MODEL", "VARIABLES", "OBSERVERS", "SKILLS"} & {*bindings(module.body)}


def test_every_name_that_the_emitter_writes_by_itself_is_reserved() -> None:
    for build_plan in plans_of_all_constructs():
        files = emit(build_plan)
        entry = files[f"{build_plan.name}/__init__.py"]
        functions = {node.name for node in ast.parse(entry).body if isinstance(node, ast.FunctionDef)}

        assert {"MODEL", "start"} < own_bindings(entry) | functions <= entry_names(build_plan.checked.spec)
        for module in build_plan.modules:
            assert own_bindings(files[f"{build_plan.name}/{module.name}.py"]) <= MODULE_NAMES, module.name
