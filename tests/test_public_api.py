"""The public API: one page, the `__all__` of its modules, and imports from them agree."""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from codra_dsl import runtime

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs/reference/public-api.md"
ROW_PATTERN = re.compile(r"^\| `(?P<module>codra_dsl[\w.]*)` \| [^|]+ \| (?P<names>[^|]+) \|$", re.MULTILINE)
PRODUCT = "codra_dsl"


def read_listed_names() -> Mapping[str, tuple[str, ...]]:
    """The names that the page lists, by module."""
    rows = list(ROW_PATTERN.finditer(PAGE.read_text("utf-8")))
    assert len(rows) == PAGE.read_text("utf-8").count("\n| `")
    return {row["module"]: tuple(re.findall(r"`(\w+)`", row["names"])) for row in rows}


LISTED_NAMES = read_listed_names()


def source_file(module: str) -> Path:
    """The file of a module of the product; some modules need libraries that tests do not have."""
    path = ROOT / module.replace(".", "/")
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def defined_names(tree: ast.Module) -> Iterator[str]:
    """Yield the names that a module defines or imports at its top level."""
    for node in tree.body:
        match node:
            case ast.Import(names=names) | ast.ImportFrom(names=names):
                yield from (alias.asname or alias.name for alias in names)
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                yield name
            case ast.Assign(targets=targets):
                yield from (target.id for target in targets if isinstance(target, ast.Name))
            case ast.AnnAssign(target=ast.Name(id=name)):
                yield name
            case ast.If(test=ast.Name(id="TYPE_CHECKING"), body=body):  # imported when a program first uses it
                yield from defined_names(ast.Module(body, []))


@pytest.mark.parametrize("module", LISTED_NAMES)
def test_the_page_lists_what_a_public_module_declares(module: str) -> None:
    tree = ast.parse(source_file(module).read_text("utf-8"))
    declared_lists = [
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and node.targets[0].id == "__all__"
    ]

    assert declared_lists == [list(LISTED_NAMES[module])]
    assert set(LISTED_NAMES[module]) <= set(defined_names(tree))


def test_every_name_of_the_runtime_can_be_imported_and_no_other() -> None:
    assert [name for name in runtime.__all__ if not hasattr(runtime, name)] == []
    assert set(runtime.__all__) <= set(dir(runtime))
    with pytest.raises(AttributeError, match="has no attribute 'Observer'"):
        getattr(runtime, "Observer")  # noqa: B009 - type checkers refuse the attribute


def test_type_checkers_refuse_other_names_of_the_runtime() -> None:
    tree = ast.parse(Path(runtime.__file__).read_text())
    assert "__getattr__" not in [node.name for node in tree.body if isinstance(node, ast.FunctionDef)]


def product_imports(text: str) -> Iterator[tuple[str, str]]:
    """Yield the modules and names of the product that Python code imports; a module alone has no name."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names if alias.name.split(".")[0] == PRODUCT)
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == PRODUCT:
            yield from ((node.module or "", alias.name) for alias in node.names)


def find_private_imports(text: str) -> list[str]:
    """Return the imports that the page does not allow."""
    return [
        f"{module} {name}".strip()
        for module, name in product_imports(text)
        if module not in LISTED_NAMES or (name and name not in LISTED_NAMES[module])
    ]


def test_a_private_import_is_noticed() -> None:
    assert find_private_imports("from codra_dsl.generation.algorithm2 import plan") == [
        "codra_dsl.generation.algorithm2 plan"
    ]
    assert find_private_imports("from codra_dsl.runtime import context") == ["codra_dsl.runtime context"]
    assert find_private_imports("from codra_dsl.runtime import SimClock\nimport codra_dsl") == []


@pytest.mark.parametrize("folder", ["codra_papers", "examples"])
def test_code_outside_the_product_imports_public_names_only(folder: str) -> None:
    files = sorted((ROOT / folder).rglob("*.py"))
    private_imports = {
        path.relative_to(ROOT).as_posix(): find_private_imports(path.read_text("utf-8")) for path in files
    }

    assert files
    assert {path: names for path, names in private_imports.items() if names} == {}


def test_the_docs_import_public_names_only() -> None:
    block_pattern = re.compile(r"^```python[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    private_imports = {
        page.relative_to(ROOT).as_posix(): [
            name for text in block_pattern.findall(page.read_text("utf-8")) for name in find_private_imports(text)
        ]
        for page in pages
    }

    assert {page: names for page, names in private_imports.items() if names} == {}


def test_the_import_contract_allows_public_modules_only() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]
    (contract,) = (candidate for candidate in settings["contracts"] if candidate["id"] == "public-api")
    allowed_modules = {line.removeprefix("codra_papers.** -> ") for line in contract["ignore_imports"]}

    assert allowed_modules <= set(LISTED_NAMES)
