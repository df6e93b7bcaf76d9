"""The public API: one page, the `__all__` of its modules, and imports from them agree."""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs/reference/public-api.md"
ROW = re.compile(r"^\| `(?P<module>codra_dsl[\w.]*)` \| [^|]+ \| (?P<names>[^|]+) \|$", re.MULTILINE)
PRODUCT = "codra_dsl"


def listed() -> Mapping[str, tuple[str, ...]]:
    """The names that the page lists, by module."""
    rows = list(ROW.finditer(PAGE.read_text("utf-8")))
    assert len(rows) == PAGE.read_text("utf-8").count("\n| `")
    return {row["module"]: tuple(re.findall(r"`(\w+)`", row["names"])) for row in rows}


LISTED = listed()


def source(module: str) -> Path:
    """The file of a module of the product; some modules need libraries that tests do not have."""
    path = ROOT / module.replace(".", "/")
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def defined(tree: ast.Module) -> Iterator[str]:
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


@pytest.mark.parametrize("module", LISTED)
def test_the_page_lists_what_a_public_module_declares(module: str) -> None:
    tree = ast.parse(source(module).read_text("utf-8"))
    declared = [
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and node.targets[0].id == "__all__"
    ]

    assert declared == [list(LISTED[module])]
    assert set(LISTED[module]) <= set(defined(tree))


def imports(text: str) -> Iterator[tuple[str, str]]:
    """Yield the modules and names of the product that Python code imports; a module alone has no name."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names if alias.name.split(".")[0] == PRODUCT)
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == PRODUCT:
            yield from ((node.module or "", alias.name) for alias in node.names)


def private(text: str) -> list[str]:
    """Return the imports that the page does not allow."""
    return [
        f"{module} {name}".strip()
        for module, name in imports(text)
        if module not in LISTED or (name and name not in LISTED[module])
    ]


def test_a_private_import_is_noticed() -> None:
    assert private("from codra_dsl.generation.algorithm2 import plan") == ["codra_dsl.generation.algorithm2 plan"]
    assert private("from codra_dsl.runtime import context") == ["codra_dsl.runtime context"]
    assert private("from codra_dsl.runtime import SimClock\nimport codra_dsl") == []


@pytest.mark.parametrize("folder", ["codra_papers", "examples"])
def test_code_outside_the_product_imports_public_names_only(folder: str) -> None:
    files = sorted((ROOT / folder).rglob("*.py"))
    private_imports = {path.relative_to(ROOT).as_posix(): private(path.read_text("utf-8")) for path in files}

    assert files
    assert {path: names for path, names in private_imports.items() if names} == {}


def test_the_docs_import_public_names_only() -> None:
    block = re.compile(r"^```python[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    private_imports = {
        page.relative_to(ROOT).as_posix(): [
            name for text in block.findall(page.read_text("utf-8")) for name in private(text)
        ]
        for page in pages
    }

    assert {page: names for page, names in private_imports.items() if names} == {}


def test_the_import_contract_allows_public_modules_only() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]
    (contract,) = (declared for declared in settings["contracts"] if declared["id"] == "public-api")
    allowed = {line.removeprefix("codra_papers.** -> ") for line in contract["ignore_imports"]}

    assert allowed <= set(LISTED)
