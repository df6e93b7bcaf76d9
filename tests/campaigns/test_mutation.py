"""The changes of `make mutation`, and the tests that belong to a module."""

from __future__ import annotations

import ast

from tests.campaigns.mutation.belonging import tests_of as stages_of
from tests.campaigns.mutation.changes import changes

SOURCE = b'''\
"""Doc."""
if TYPE_CHECKING:
    from a import b

@cache(size=1)
def f(x: int = 5, *y: tuple[int, 2]) -> None:
    "\xc3\xa9"; assert x < 1
    if x  is  not y or not (x + 1):
        return g("a", x, *y) and f"{x < 2}"
    return g("\xc3\xa9", -x)
'''
RESULTS = [
    "def f(x: int = 6, *y: tuple[int, 2]) -> None:",
    "if (not (x  is  not y or not (x + 1))):",
    "if x  is  not y and not (x + 1):",
    "if x  is y or not (x + 1):",
    "if x  is  not y or (x + 1):",
    "if x  is  not y or not (x - 1):",
    "if x  is  not y or not (x + 2):",
    "return None",
    'return g("a", x, *y) or f"{x < 2}"',
    "return None",
    'return g(-x, "\u00e9")',
]


def test_each_change_replaces_one_expression_and_nothing_else() -> None:
    found = list(changes(SOURCE))
    added_lines = [change.diff("f.py").splitlines()[-1][1:].strip() for change in found]

    assert sorted(added_lines) == sorted(RESULTS)
    assert all(change.is_valid for change in found)
    assert all(len(change.diff("f.py").splitlines()) == 5 for change in found)
    assert ast.dump(ast.parse(SOURCE)) not in {ast.dump(ast.parse(change.result)) for change in found}


def test_the_nearest_tests_of_a_module_come_first_and_none_is_repeated() -> None:
    module = "codra_dsl.language.check.quality.times"
    imports = {
        "tests/generation/test_names.py": {"codra_dsl.compiler"},
        "tests/language/check/test_cycles.py": set[str](),
        "tests/language/check/test_quality.py": {module},
        "tests/language/check/test_times.py": set[str](),
        "tests/runtime/test_clock.py": {"codra_dsl.runtime"},
        "tests/tooling/test_selection.py": {"codra_dsl.language.check"},
        "tests/workspace/test_cache.py": {module, "codra_dsl.language.check"},
    }

    assert list(filter(None, stages_of("codra_dsl/language/check/quality/times.py", imports))) == [
        ["tests/language/check/test_times.py", "tests/language/check/test_quality.py"],
        ["tests/test_cases.py"],
        ["tests/language/check/test_cycles.py"],
        ["tests/workspace/test_cache.py"],
        ["tests/generation/test_names.py"],
        ["tests/tooling/test_selection.py"],
    ]
