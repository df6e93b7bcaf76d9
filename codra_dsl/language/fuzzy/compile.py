"""Engine -> the text of a Python module with two functions: `infer` for numbers, and `infer_bounds` for bounds."""

from __future__ import annotations

import re

from codra_dsl.language.fuzzy.body import Body
from codra_dsl.language.fuzzy.check import concluded_terms, depends_on_inputs
from codra_dsl.language.fuzzy.dialects import BOUNDS, NUMBERS, literal, snake_case, tuple_of
from codra_dsl.language.fuzzy.model import Engine, OutputVariable
from codra_dsl.language.fuzzy.names import Names
from codra_dsl.language.fuzzy.shapes import membership
from codra_dsl.language.fuzzy.write import rule_text
from codra_dsl.language.project import GENERATED_API

_LONGEST_LINE = 120
_IMPORTED_CLASSES = ("BoundedInference", "Bounds", "Inference")
_MODULES = (
    "activations",
    "bounded_activations",
    "bounded_formulas",
    "bounded_outputs",
    "bounds",
    "defuzzifiers",
    "formulas",
    "hedges",
    "norms",
    "outputs",
    "terms",
)


def compile_engine(engine: Engine) -> str:
    """Return the module of an engine for which `read_fll` or `check.engine_problems` reports no mistakes.

    The module has `infer(*inputs, previous=...) -> Inference` and `infer_bounds(*inputs, previous=...) ->
    BoundedInference`. `INPUTS`, `OUTPUTS` and `RULES` are the names of the arguments, values and strengths, in their
    order. `RANGES` has the bounds that are assumed for each input while the input is unknown. From codra, the module
    imports only `codra_dsl.runtime.generated_api`. The same engine gives the same text.
    """
    names = Names()
    constants = {output.name: names.claim(output.name.upper()) for output in engine.outputs}
    parts = [
        _names_source("INPUTS", [variable.name for variable in engine.inputs]),
        _ranges_source(engine),
        _names_source("OUTPUTS", [output.name for output in engine.outputs]),
        _names_source(
            "RULES", [rule_text(rule) for block in engine.blocks if block.is_enabled for rule in block.rules]
        ),
    ]
    numbers = Body(engine, NUMBERS, constants, names.taken_names)
    bounds = Body(engine, BOUNDS, constants, names.taken_names)
    functions = [numbers.function("infer"), bounds.function("infer_bounds")]
    outputs = [
        _output_source(output, engine, constants[output.name], numbers.conclusions[output.name])
        for output in engine.outputs
        if output.is_enabled
    ]
    body = "\n".join(parts) + "\n\n" + "".join(f"{text}\n" for text in outputs) + "\n\n" + "\n\n\n".join(functions)
    return f"{_heading(engine)}\n{_imports(body)}\n\n{body}\n"


def _heading(engine: Engine) -> str:
    name = ascii(engine.name)[1:-1].replace("\\", "/").replace('"', "'")
    return f'"""Fuzzy engine {name or "without a name"}: made from its declaration, not to be edited."""\n'


def _names_source(constant: str, values: list[str]) -> str:
    if not values:
        return f"{constant}: tuple[str, ...] = ()"
    return f"{constant} = (\n" + "".join(f"    {literal(value)},\n" for value in values) + ")"


def _ranges_source(engine: Engine) -> str:
    bounds_lines = [
        f"    Bounds({literal(variable.minimum)}, {literal(variable.maximum)}),\n" for variable in engine.inputs
    ]
    return (
        f"RANGES: tuple[Bounds, ...] = (\n{''.join(bounds_lines)})"
        if bounds_lines
        else "RANGES: tuple[Bounds, ...] = ()"
    )


def _imports(body: str) -> str:
    modules = [module for module in _MODULES if re.search(rf"(?<![\w.']){module}\.", body)]
    names = [*_IMPORTED_CLASSES, *modules]
    lines = ["from __future__ import annotations\n"]
    if "math." in body:
        lines.append("import math\n")
    line = f"from {GENERATED_API} import {', '.join(names)}"
    wrapped_line = f"from {GENERATED_API} import (\n" + "".join(f"    {name},\n" for name in names) + ")"
    lines.append(line if len(line) <= _LONGEST_LINE else wrapped_line)
    return "\n".join(lines)


def _norm(word: str | None) -> str:
    return "norms.unbounded_sum" if word is None else f"norms.{snake_case(word)}"


def _output_source(output: OutputVariable, engine: Engine, constant: str, conclusions: list[tuple[int, str]]) -> str:
    assert output.defuzzifier is not None
    if output.defuzzifier.method.is_weighted:
        indices = tuple_of([str(term) for term, _ in conclusions]) if conclusions else "()"
        return f"{constant} = outputs.Weighted(aggregation={_norm(output.aggregation)}, conclusions={indices})"
    lines = [
        f"{constant} = outputs.Integral(",
        f"    minimum={literal(output.minimum)},",
        f"    maximum={literal(output.maximum)},",
        f"    resolution={output.defuzzifier.resolution},",
        f"    defuzzify=defuzzifiers.{snake_case(output.defuzzifier.method)},",
        f"    aggregation={_norm(output.aggregation)},",
    ]
    terms = concluded_terms(output, engine)
    if depends_on_inputs(output, engine) or not terms:
        lines.append("    memberships=(),")
    else:
        memberships = [f"        lambda x: {membership(term, 'x', {'x': 'x'}, [], NUMBERS)},\n" for term in terms]
        lines.append(f"    memberships=(\n{''.join(memberships)}    ),")
    conclusion_lines = [f"        outputs.Conclusion(term={term}, implication={norm}),\n" for term, norm in conclusions]
    lines.append(f"    conclusions=(\n{''.join(conclusion_lines)}    )," if conclusion_lines else "    conclusions=(),")
    return "\n".join([*lines, ")"])
