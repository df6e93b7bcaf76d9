"""The files of a new project, from the templates in the folder `project`."""

from __future__ import annotations

from pathlib import Path

from codra_dsl.starter.schema import SCHEMA_PATH, published_schema

_TEMPLATES = Path(__file__).parent / "project"
_ENDING = ".in"
_NAME = "@NAME@"
_CODRA = "@CODRA@"


def starter_texts(name: str, requirement: str) -> dict[str, str]:
    """Return the files of a new project by path, with `/`, in alphabetical order.

    Args:
        name: of the spec; an identifier.
        requirement: how pip is told to install codra, e.g. `codra-dsl==0.1.0`.
    """
    texts = {SCHEMA_PATH: published_schema()}
    for template in sorted(_TEMPLATES.rglob(f"*{_ENDING}")):
        path = template.relative_to(_TEMPLATES).as_posix().removesuffix(_ENDING)
        text = template.read_text(encoding="utf-8")
        texts[path.replace(_NAME, name)] = text.replace(_NAME, name).replace(_CODRA, requirement)
    return dict(sorted(texts.items()))
