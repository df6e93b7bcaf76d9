"""The source text of a term's membership function, and of the inverse of this function."""

from __future__ import annotations

from codra_dsl.language.fuzzy.dialects import Dialect, Kind, literal, tuple_of
from codra_dsl.language.fuzzy.model import AnyTerm, FormulaTerm, Term
from codra_dsl.language.fuzzy.words import Shape


def membership(term: AnyTerm, x: str, names: dict[str, str], inputs: list[str], dialect: Dialect) -> str:
    """Return the source of the degree that a term has at x.

    Args:
        term: any term of the engine.
        x: the source of the value.
        names: the local names of the variables, for formulas.
        inputs: the local names of all inputs in order, for `Linear`.
        dialect: the arithmetic of the source.
    """
    if isinstance(term, FormulaTerm):
        return dialect.formula(term.formula, names | {"x": x})
    if term.shape is Shape.Linear:
        return dialect.linear(inputs, term.parameters)
    return dialect.call(Kind.IMAGE, f"terms.{term.shape.value.function}", x, *_parameters(term))


def inverse(term: Term, y: str, dialect: Dialect) -> str:
    """Return the source of the x at which a monotone term has the degree y."""
    return dialect.call(Kind.INVERSE, f"terms.{term.shape.value.function}_inverse", y, *_parameters(term))


def _parameters(term: Term) -> list[str]:
    if term.shape is Shape.Discrete:
        parameters = [tuple_of([literal(value) for value in term.parameters[start::2]]) for start in (0, 1)]
    else:
        parameters = [literal(value) for value in term.parameters]
    return [*parameters, *([] if term.height == 1.0 else [literal(term.height)])]
