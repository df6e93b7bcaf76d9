"""A picture of coverage: the skills of the main execution, and the variables on which they decide, in colours."""

from __future__ import annotations

from codra_dsl.tooling.main_execution.coverage import Coverage, JudgedDecision
from codra_dsl.tooling.report.dot import attributes_text, digraph, label_text, quote, width_text
from codra_dsl.tooling.report.findings import visible_text
from codra_dsl.tooling.report.looks import NODE_LOOKS, NodeLook, ShownKind

COVERED = "#b3e2d5"
PARTLY_COVERED = "#f9f4ae"
NOT_COVERED = "#f2b8a0"
UNUSED = "#e4e4e4"
_LEGEND = {
    "every decision is covered": COVERED,
    "some decisions are covered": PARTLY_COVERED,
    "no decision is covered": NOT_COVERED,
    "no decision needs it": UNUSED,
}


def coverage_dot(coverage: Coverage) -> str:
    """Return the picture in Graphviz's language: arrows lead from variables to the skills that decide on them."""
    lines: list[str] = []
    by_variable: dict[str, list[JudgedDecision]] = {}
    by_skill: dict[str, list[JudgedDecision]] = {}
    for judged in coverage.decisions:
        by_variable.setdefault(judged.variable or judged.decision.name, []).append(judged)
        by_skill.setdefault(judged.decision.skill, []).append(judged)
    variable_look, skill_look = NODE_LOOKS[ShownKind.CONTEXT], NODE_LOOKS[ShownKind.SKILL]
    lines += (_node(f"variable {name}", name, variable_look, _colour(group)) for name, group in by_variable.items())
    lines += (_node(f"skill {name}", name, skill_look, _colour(group)) for name, group in by_skill.items())
    for name, group in by_variable.items():
        for judged in group:
            colour, style = ("#555555", "solid") if judged.is_covered else ("#d55e00", "dashed")
            edge = f"{quote(f'variable {name}')} -> {quote(f'skill {judged.decision.skill}')}"
            lines.append(f"{edge} {attributes_text({'color': colour, 'style': style})};")
    lines += (_node(f"unused {item.name}", item.name, variable_look, UNUSED) for item in coverage.unused_variables)
    lines += ["subgraph cluster_legend {", f"graph {attributes_text({'label': 'colours', 'style': 'rounded'})};"]
    lines += (_node(f"legend {text}", text, variable_look, colour) for text, colour in _LEGEND.items())
    lines.append("}")
    return digraph(lines, "LR")


def _node(identifier: str, label: str, look: NodeLook, colour: str) -> str:
    text = label_text(visible_text(label))
    attributes = {"label": text, "shape": look.shape, "style": look.style, "fillcolor": colour}
    return f"{quote(identifier)} {attributes_text(attributes | {'width': width_text(text, look.shape)})};"


def _colour(group: list[JudgedDecision]) -> str:
    covered_count = sum(judged.is_covered for judged in group)
    return COVERED if covered_count == len(group) else PARTLY_COVERED if covered_count else NOT_COVERED
