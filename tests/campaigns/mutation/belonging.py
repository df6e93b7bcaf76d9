"""The rooms of the product, and the tests that belong to a module."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath

from tests.changed import imported_modules, mirrored_folder, module_of

ROOM_BY_PATH = {
    "codra_dsl/language/check": "check",
    "codra_dsl/language/load": "load",
    "codra_dsl/generation/algorithm2.py": "plan",
    "codra_dsl/generation/build_plan": "plan",
    "codra_dsl/generation/emit": "emit",
    "codra_dsl/generation/output.py": "emit",
    "codra_dsl/runtime": "runtime",
    "codra_dsl/runtime/knowledge": "knowledge",
    "codra_dsl/runtime/loops": "loops",
}
_COMPILER = "codra_dsl.compiler"
_LEFT_OUT = ("tests/integrations/rafcon/", "tests/papers/", "tests/campaigns/")


def modules(root: Path) -> Iterator[tuple[str, str]]:
    """Yield the files of all rooms, sorted, each with its room: that of the deepest folder which has one."""
    for file in sorted(path.relative_to(root) for path in (root / "codra_dsl").rglob("*.py")):
        rooms = [ROOM_BY_PATH[path.as_posix()] for path in (file, *file.parents) if path.as_posix() in ROOM_BY_PATH]
        if rooms:
            yield file.as_posix(), rooms[0]


def imports_by_test(root: Path) -> dict[str, set[str]]:
    """Return the modules that each test file imports, without tests of the papers and of RAFCON."""
    tests = sorted(path.relative_to(root).as_posix() for path in (root / "tests").rglob("test_*.py"))
    return {
        test: imported_modules((root / test).read_text("utf-8")) for test in tests if not test.startswith(_LEFT_OUT)
    }


def tests_of(file: str, imports: Mapping[str, set[str]]) -> Iterator[list[str]]:
    """Yield the test files that belong to a module, the nearest first; no file is repeated.

    The first are those of the module's name, and those of its folder that import it; for the compiler, the cases are
    next. Then come the others of its folder, those elsewhere that import the module, and at last, one by one, those
    that import its package, or the compiler if the module is a part of it. If no folder mirrors that of the module, the
    nearest one above counts.
    """
    module, stem = module_of(file), PurePosixPath(file).stem
    is_of_runtime = file.startswith("codra_dsl/runtime")
    packages = {module.rpartition(".")[0], ".".join(module.split(".")[:3]), *([] if is_of_runtime else [_COMPILER])}
    folders = {PurePosixPath(test).parent.as_posix() for test in imports}
    mirrored = PurePosixPath(mirrored_folder(file) or "tests")
    folder = next(path.as_posix() for path in (mirrored, *mirrored.parents) if path.as_posix() in folders)
    in_folder = [test for test in imports if PurePosixPath(test).parent.as_posix() == folder]
    named = [test for test in imports if test.startswith(folder) and test.endswith(f"/test_{stem}.py")]
    importing = [test for test in imports if module in imports[test]]
    seen = set[str]()
    for stage in (
        named + [test for test in importing if test in in_folder],
        [] if is_of_runtime else ["tests/test_cases.py"],
        in_folder,
        importing,
        *([test] for test in imports if packages & imports[test]),
    ):
        yield [test for test in dict.fromkeys(stage) if test not in seen]
        seen.update(stage)
