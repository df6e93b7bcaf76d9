"""Pictures of fuzzy engines: the terms of their variables, and an output over two inputs."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from types import ModuleType

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from codra_dsl.language.fuzzy import compile_engine
from codra_dsl.language.fuzzy.check import names_in
from codra_dsl.language.fuzzy.model import AnyTerm, Call, Engine, Formula, FormulaTerm, Name, Number, Variable
from codra_dsl.language.fuzzy.words import Shape
from codra_dsl.runtime.loops.fuzzy import formulas, terms

__all__ = [
    "draw_memberships",
    "draw_surface",
    "load_engine",
    "memberships_picture",
    "surface",
]

_POINT_COUNT = 401
_VALUES_PER_INPUT = 61
_COLUMN_COUNT = 3


def load_engine(engine: Engine) -> ModuleType:
    """Compile an engine to a module, execute the module, and return it."""
    module = ModuleType(engine.name or "engine")
    exec(compile(compile_engine(engine), f"<{module.__name__}>", "exec"), module.__dict__)
    return module


def draw_memberships(path: Path, engine: Engine) -> None:
    """Draw the terms of each variable over its range. Terms that depend on other variables are left out.

    Args:
        path: the file of the picture; its suffix (`.png`, `.svg`) determines the format.
        engine: an engine whose variables have finite ranges.
    """
    path.write_bytes(memberships_picture(engine.variables, path.suffix.removeprefix(".") or "png"))


def memberships_picture(variables: Sequence[Variable], format_: str) -> bytes:
    """Return the picture that `draw_memberships` draws.

    Args:
        variables: at least one variable; their ranges are finite.
        format_: `png`, `svg`, or another format of matplotlib.
    """
    row_count = -(-len(variables) // _COLUMN_COUNT)
    figure = Figure(figsize=(4.2 * min(_COLUMN_COUNT, len(variables)), 2.3 * row_count), layout="constrained")
    for index, variable in enumerate(variables):
        axes = figure.add_subplot(row_count, min(_COLUMN_COUNT, len(variables)), index + 1)
        _draw_terms(axes, variable)
    return _rendered(figure, format_)


def draw_surface(
    path: Path, engine: Engine, output: str, inputs: tuple[str, str], fixed: Mapping[str, float] | None = None
) -> None:
    """Draw an output over two inputs; the picture is blank where the output is unknown.

    Args:
        path: the file of the picture.
        engine: an engine whose two inputs have finite ranges.
        output: the name of the output.
        inputs: the names of the inputs along x and y.
        fixed: the values of the other inputs; the middle of their range by default.
    """
    values = surface(engine, output, inputs, fixed or {})
    x_variable, y_variable = (engine.variable(name) for name in inputs)
    figure = Figure(figsize=(6.4, 4.8), layout="constrained")
    axes = figure.add_subplot()
    extent = (x_variable.minimum, x_variable.maximum, y_variable.minimum, y_variable.maximum)
    picture = axes.imshow(values, origin="lower", extent=extent, aspect="auto", cmap="viridis")
    contour_lines = axes.contour(values, origin="lower", extent=extent, colors="white", linewidths=0.7)
    axes.clabel(contour_lines, fontsize=8)
    axes.set_xlabel(x_variable.name)
    axes.set_ylabel(y_variable.name)
    axes.set_title(output, fontsize=10, loc="left")
    figure.colorbar(picture, ax=axes)
    path.write_bytes(_rendered(figure, path.suffix.removeprefix(".") or "png"))


def surface(engine: Engine, output: str, inputs: tuple[str, str], fixed: Mapping[str, float]) -> NDArray[np.float64]:
    """Return the values that `draw_surface` draws: one row for each of 61 values of the second input, ascending."""
    infer = load_engine(engine).infer
    index = [variable.name for variable in engine.outputs].index(output)
    base_values = {variable.name: (variable.minimum + variable.maximum) / 2.0 for variable in engine.inputs} | dict(
        fixed
    )
    x_range, y_range = ((engine.variable(name).minimum, engine.variable(name).maximum) for name in inputs)
    rows = [
        [
            infer(*(base_values | dict(zip(inputs, (x, y), strict=True))).values()).values[index]
            for x in np.linspace(*x_range, _VALUES_PER_INPUT).tolist()
        ]
        for y in np.linspace(*y_range, _VALUES_PER_INPUT).tolist()
    ]
    return np.array(rows)


def _draw_terms(axes: Axes, variable: Variable) -> None:
    xs = np.linspace(variable.minimum, variable.maximum, _POINT_COUNT).tolist()
    for term in variable.terms:
        degree = membership_function(term)
        if degree is not None:
            axes.plot(xs, [degree(x) for x in xs], label=term.name)
    axes.set_title(variable.name, fontsize=10, loc="left")
    axes.set_ylim(-0.03, 1.05)
    axes.legend(fontsize=8, frameon=False)


def membership_function(term: AnyTerm) -> Callable[[float], float] | None:
    """Return the membership function of a term; None if it depends on other variables. No source is compiled."""
    if isinstance(term, FormulaTerm):
        formula = term.formula
        return None if names_in(formula) - {"x"} else lambda x: _formula_value(formula, x)
    if term.shape is Shape.Linear:
        return None
    is_discrete, form = term.shape is Shape.Discrete, term.shape.value
    parameters = (term.parameters[::2], term.parameters[1::2]) if is_discrete else term.parameters
    function: Callable[..., float] = getattr(terms, form.function)
    arguments = (*parameters, *((term.height,) if form.has_height else ()))
    return lambda x: function(x, *arguments)


def _formula_value(formula: Formula, x: float) -> float:
    if isinstance(formula, Number):
        return formula.value
    if isinstance(formula, Name):
        return x
    assert isinstance(formula, Call)
    return formulas.calculate(formula.function, *(_formula_value(operand, x) for operand in formula.operands))


def _rendered(figure: Figure, format_: str) -> bytes:
    """Return a figure as a file. Warnings are ignored: they are about letters that the font does not have."""
    buffer = BytesIO()
    with mpl.rc_context({"svg.hashsalt": "codra"}), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        figure.savefig(buffer, format=format_, dpi=90, metadata={"Date": None} if format_ == "svg" else None)
    return buffer.getvalue()
