"""The structure of both packages: sizes of folders, and no import cycles."""

from __future__ import annotations

from pathlib import Path

import grimp
import networkx
import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("codra_dsl", "codra_papers")
MOST_ENTRIES = 14
MOST_MODULES = 20


def test_the_product_has_few_entries_at_its_top() -> None:
    unseen = {"__init__.py", "__pycache__", "py.typed"}
    entries = sorted(path.name for path in (ROOT / "codra_dsl").iterdir() if path.name not in unseen)

    assert len(entries) <= MOST_ENTRIES, entries


@pytest.mark.parametrize("package", PACKAGES)
def test_no_folder_holds_more_modules_than_a_reader_can_survey(package: str) -> None:
    folders = {path.parent for path in (ROOT / package).rglob("*.py")}
    counts = {
        folder.relative_to(ROOT).as_posix(): sum(path.name != "__init__.py" for path in folder.glob("*.py"))
        for folder in folders
    }

    assert {folder: count for folder, count in counts.items() if count > MOST_MODULES} == {}


def test_no_module_imports_another_in_a_cycle() -> None:
    """Imports under TYPE_CHECKING and inside functions count, and so does a package's `__init__`."""
    imports = grimp.build_graph(*PACKAGES, cache_dir=None)
    graph = networkx.DiGraph(
        (module, imported)
        for module in imports.modules
        for imported in imports.find_modules_directly_imported_by(module)
    )

    cycles = [sorted(group) for group in networkx.strongly_connected_components(graph) if len(group) > 1]
    assert cycles == []
