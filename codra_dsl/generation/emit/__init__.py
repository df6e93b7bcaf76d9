"""Turn a plan into text: the files of a generated package. The emitter reads no disk, no clock and no environment."""

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
    """Return the files of a plan's package by path, relative to the output folder, sorted.

    The same plan gives the same bytes on every machine, with all settings and hash seeds. Only `sources.json` holds
    the elements' places in the spec, so that a comment added there changes no other file.
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
