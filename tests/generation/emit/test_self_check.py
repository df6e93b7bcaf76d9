"""The proof of emitted text: it agrees with Python's compiler, for complete texts and for pieces."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.generation.emit.self_check import BrokenOutputError, prove

GENERATED = Path(__file__).parents[3] / "generated"
MODULES = {path.relative_to(GENERATED).as_posix(): path.read_text("utf-8") for path in GENERATED.rglob("*.py")}
PIECES = st.one_of(
    st.sampled_from(
        ["", '"', "'", "\\", "#", "(", ")", ",", "\n", "\n\n", "    ", "class", "f", "0", "=", "\0", '"""']
    ),
    st.sampled_from(["yield x", "x for x in y", "*", "await x", "return", "def ", "name=", " = Algorithm("]),
    st.text(max_size=3),
)


def can_be_compiled(text: str) -> bool:
    try:
        compile(text, "", "exec", dont_inherit=True)
    except (SyntaxError, ValueError):
        return False
    return True


def is_proven(text: str) -> bool:
    try:
        prove({"module.py": text})
    except BrokenOutputError:
        return False
    return True


@pytest.mark.parametrize("path", sorted(MODULES))
def test_emitted_text_is_proven(path: str) -> None:
    prove({path: MODULES[path]})


@settings(max_examples=75, deadline=None)
@given(st.data())
def test_the_proof_of_a_damaged_module_agrees_with_the_compiler(data: st.DataObject) -> None:
    """Some characters of a real module are replaced by characters that may break the module, or may hide an error."""
    text = MODULES[data.draw(st.sampled_from(sorted(MODULES)))]
    for _ in range(data.draw(st.integers(1, 3))):
        start = data.draw(st.integers(0, len(text)))
        text = text[:start] + data.draw(PIECES) + text[start + data.draw(st.integers(0, 12)) :]

    assert is_proven(text) == can_be_compiled(text)


@pytest.mark.parametrize("path", sorted(path for path in MODULES if path.count("/") == 1))
def test_an_invalid_name_is_detected_in_every_piece(path: str) -> None:
    lines = MODULES[path].splitlines(keepends=True)
    for index, line in enumerate(lines):
        if line.startswith("def "):
            broken = "".join(
                [*lines[:index], line.replace("def ", "def class ", 1).replace(" ", " ", 1), *lines[index + 1 :]]
            )
            with pytest.raises(BrokenOutputError, match=path):
                prove({path: broken})
            named = "".join([*lines[:index], f"def class{line[line.index('(') :]}", *lines[index + 1 :]])
            with pytest.raises(BrokenOutputError, match=path):
                prove({path: named})


@pytest.mark.parametrize(
    "statements",
    [
        "VARIABLES: tuple[X, ...] = (\n    A((),\n    B()),\n)\n",  # neither item is valid alone
        "VARIABLES: tuple[X, ...] = (\n    A(x) for x in y,\n    A(x) for x in y,\n)\n",
        "VARIABLES: tuple[X, ...] = (\n    A(),\n    B()\n    C(),\n)\n",
        "X = Algorithm(\n\n)\n\n\ndef y(observer: Observer) -> Behaviour:\n    return (\n\n)\n)\n",
        "def class(observer: Observer) -> Behaviour:\n    return 1\n",
        "class = Algorithm(\n)\n",
        "x = branch(class)\n",
        "x = f(build=None=1)\n",
    ],
)
def test_pieces_do_not_hide_an_error_between_them(statements: str) -> None:
    text = f'"""Title."""\n\n{statements}'

    assert is_proven(text) == can_be_compiled(text)


def test_a_file_that_is_not_json_is_named() -> None:
    with pytest.raises(BrokenOutputError, match=r"lab/graph\.json"):
        prove({"lab/__init__.py": "", "lab/graph.json": "{"})
