"""The structure of both packages: sizes of folders, and no import cycles."""

from __future__ import annotations

from pathlib import Path

import grimp
import networkx
import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("codra_dsl", "codra_papers")
MAX_ENTRIES = 14
MAX_MODULES = 20


def test_the_product_has_few_entries_at_its_top() -> None:
    ignored_names = {"__init__.py", "__pycache__", "py.typed"}
    entries = sorted(path.name for path in (ROOT / "codra_dsl").iterdir() if path.name not in ignored_names)

    assert len(entries) <= MAX_ENTRIES, entries


@pytest.mark.parametrize("package", PACKAGES)
def test_no_folder_holds_more_modules_than_a_reader_can_survey(package: str) -> None:
    folders = {path.parent for path in (ROOT / package).rglob("*.py")}
    module_counts = {
        folder.relative_to(ROOT).as_posix(): sum(path.name != "__init__.py" for path in folder.glob("*.py"))
        for folder in folders
    }

    assert {folder: count for folder, count in module_counts.items() if count > MAX_MODULES} == {}


def test_no_module_imports_another_in_a_cycle() -> None:
    """Imports under TYPE_CHECKING and inside functions count, and so does a package's `__init__`."""
    import_graph = grimp.build_graph(*PACKAGES, cache_dir=None)
    graph = networkx.DiGraph(
        (module, imported_module)
        for module in import_graph.modules
        for imported_module in import_graph.find_modules_directly_imported_by(module)
    )

    cycles = [sorted(component) for component in networkx.strongly_connected_components(graph) if len(component) > 1]
    assert cycles == []
