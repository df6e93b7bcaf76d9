"""Turn a plan into the text of a generated package's files. The emitter reads no disk, no clock and no environment."""

from __future__ import annotations

from collections.abc import Mapping

from codra_dsl.generation.build_plan import BuildPlan
from codra_dsl.generation.build_plan.names import KNOWLEDGE_MODULE
from codra_dsl.generation.emit.entry import entry_text
from codra_dsl.generation.emit.knowledge import knowledge_text
from codra_dsl.generation.emit.loops import mape_texts
from codra_dsl.generation.emit.modules import module_texts
from codra_dsl.generation.emit.records import SOURCES, graph_text, manifest_text, sources_text
from codra_dsl.generation.emit.rendering import render

__all__ = ["emit", "package_text"]


def emit(plan: BuildPlan) -> Mapping[str, str]:
    """Return a mapping from paths, sorted and relative to the output folder, to the texts of a plan's package.

    The same plan gives the same bytes on every machine, with any settings and any hash seed. Only `sources.json` has
    the places of elements in the spec, so that a comment added to the spec changes no other file.
    """
    outputs = {
        "__init__.py": entry_text(plan),
        "graph.json": graph_text(plan),
        **dict(module_texts(plan)),
    }
    if plan.checked.knowledge is not None:
        outputs[f"{KNOWLEDGE_MODULE}.py"] = knowledge_text(plan, plan.checked.knowledge)
    if plan.checked.mape is not None:
        outputs |= dict(mape_texts(plan, plan.checked.mape))
    outputs["manifest.json"] = manifest_text(plan, outputs)
    outputs[SOURCES] = sources_text(plan)
    return {f"{plan.name}/{path}": outputs[path] for path in sorted(outputs)}


def package_text() -> str:
    """Return the text of the `__init__.py` beside all generated packages."""
    return render("package.py.j2")
