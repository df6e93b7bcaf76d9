"""Fill the packaged templates. Templates only arrange texts: every value arrives as the text of a Python expression."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from codra_dsl.generation.build_plan import BuildPlan
from codra_dsl.generation.emit.literals import prose

if TYPE_CHECKING:
    from jinja2 import Environment


def render(template: str, **texts: object) -> str:
    """Return the text of a template that is filled with texts."""
    return _environment().get_template(template).render(**texts)


def made_by_line(plan: BuildPlan) -> str:
    """Return the line that names the source of generated code and how to renew it."""
    spec = plan.checked.spec
    file, site_file = prose(spec.file), prose(spec.site.file) if spec.site is not None else ""
    files, arguments = (f"{file} and {site_file}", f"{file} --site {site_file}") if site_file else (file, file)
    return f"Made by codra from {files}; edits are lost. Renew: codra compile {arguments}"


@cache
def _environment() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined  # noqa: PLC0415  slow, and needed only to emit

    return Environment(
        loader=PackageLoader("codra_dsl.generation.emit"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
