"""The module that generated code imports: it has exactly the names that the emitter can write."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path

import pytest

from codra_dsl.compiler import compile_paths, plan_text
from codra_dsl.generation.algorithm2 import plan
from codra_dsl.generation.emit import emit
from codra_dsl.language.behavior_trees.catalogue import BUILT_IN, PortContent
from codra_dsl.language.fuzzy import compile_engine
from codra_dsl.language.project import GENERATED_API
from codra_dsl.runtime import generated_api
from tests.generation.emit.test_emit import rich
from tests.language.behavior_trees.stories import compiled, document
from tests.language.fuzzy.engines import NAMES, stored

ROOT = Path(__file__).parents[1]
GATE_SPEC = """
codra: 1
name: gate
context: {gate_open: {type: bool, valid_for: 1 min, refresh: on_event}}
perception:
  measure_gate:
    call: kitchen.perception:measure_gate
    returns: {gap: {type: float, unit: m, range: [0, 2]}}
    identifies: {gate_open: {enter: gap > 60 cm, leave: gap < 50 cm, confirm: 2 of 3}}
skills: {open_gate: {preview: [gate_open], changes: [gate_open]}}
"""
PORT_VALUES: Mapping[PortContent, str] = {
    PortContent.TEXT: "a",
    PortContent.INTEGER: "1",
    PortContent.MILLISECONDS: "1",
    PortContent.TRUTH: "true",
    PortContent.RESULT: "SUCCESS",
    PortContent.ENTRY: "a",
    PortContent.KEY: "a",
    PortContent.OUTPUT: "{a}",
    PortContent.CONDITION: "a == 1",
    PortContent.SCRIPT: "a := 1",
}
LONG_CONDITION = " &amp;&amp; ".join(f"entry_{number} == {number}" for number in range(20))
TREES = ("<Own><A/></Own>", f'<A _while="{LONG_CONDITION}"/>', '<Script code="a := 1; a = 2"/>')


def built_in_trees() -> Iterator[str]:
    """A tree for every built-in node except SubTree, with all of its ports."""
    for name, built_in_node in BUILT_IN.items():
        if built_in_node.word != "Subtree":
            port_attributes = " ".join(f'{port.name}="{PORT_VALUES[port.content]}"' for port in built_in_node.ports)
            yield f"<{name} {port_attributes}>{'<A/>' * built_in_node.min_children}</{name}>"


def generated_texts() -> Iterator[str]:
    """Modules that together have every form of output."""
    yield from (path.read_text("utf-8") for path in sorted((ROOT / "generated").rglob("*.py")))
    yield from (compile_engine(stored(name)) for name in NAMES)
    yield from (compiled(document(tree)) for tree in (*built_in_trees(), *TREES))
    outputs = [emit(plan(rich())), emit(plan_text(GATE_SPEC, "specs/gate.yaml", ROOT).plans[0])]
    specs = ("conditions.yaml", "derived.yaml", "knowledge-everything.yaml", "poses.yaml", "loops-everything/spec.yaml")
    for spec in specs:
        path = ROOT / "tests/cases/valid" / spec
        outputs.append(compile_paths([path], path.parent).files)
    folder = ROOT / "tests/cases/valid/sites"
    outputs.append(compile_paths([folder / "spec.yaml"], folder, sites=[folder / "sites/hall_1.yaml"]).files)
    yield from (text for files in outputs for path, text in files.items() if path.endswith(".py"))


def imports_of(text: str) -> Iterator[ast.ImportFrom]:
    return (node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ImportFrom))


def lazy_imports() -> Iterator[tuple[str, str, str]]:
    """Yield the name, module and original name of names that are imported lazily, and at once only by type checkers."""
    module_tree = ast.parse(Path(str(generated_api.__file__)).read_text("utf-8"))
    (type_checking_block, _) = (node for node in module_tree.body if isinstance(node, ast.If))
    for node in type_checking_block.body:
        assert isinstance(node, ast.ImportFrom)
        yield from ((alias.asname or alias.name, str(node.module), alias.name) for alias in node.names)


def test_all_of_its_names_are_those_that_the_emitter_can_write() -> None:
    emitted_names = {
        alias.name
        for text in generated_texts()
        for node in imports_of(text)
        if node.module == GENERATED_API
        for alias in node.names
    }

    assert sorted(emitted_names) == generated_api.__all__


@pytest.mark.parametrize("name", generated_api.__all__)
def test_every_name_is_there(name: str) -> None:
    assert getattr(generated_api, name) is not None


@pytest.mark.parametrize(("name", "module_name", "original_name"), [*lazy_imports()], ids=str)
def test_a_name_that_is_imported_later_is_the_one_that_type_checkers_see(
    name: str, module_name: str, original_name: str
) -> None:
    module = import_module(module_name)
    expected_object = (
        getattr(module, original_name)
        if hasattr(module, original_name)
        else import_module(f"{module_name}.{original_name}")
    )

    assert getattr(generated_api, name) is expected_object


def test_a_name_that_it_does_not_have_is_an_error() -> None:
    with pytest.raises(AttributeError, match=r"'codra_dsl\.runtime\.generated_api' has no attribute 'Journal'"):
        _ = generated_api.Journal  # type: ignore[attr-defined]
    with pytest.raises(ImportError):
        from codra_dsl.runtime.generated_api import Journal  # type: ignore[attr-defined]  # noqa: F401


def test_a_package_without_loops_loads_no_loops_trees_and_numpy() -> None:
    code = "import sys, generated.kitchen; print(*sys.modules)"
    process = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    loaded_modules = set(process.stdout.split())

    assert GENERATED_API in loaded_modules
    assert not {"numpy", "codra_dsl.runtime.loops", "codra_dsl.runtime.behavior_trees"} & loaded_modules
