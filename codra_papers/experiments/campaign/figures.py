"""The common style of the drawings of reports."""

from __future__ import annotations

from contextlib import AbstractContextManager
from io import StringIO

import matplotlib as mpl
from matplotlib.figure import Figure


def figure_style() -> AbstractContextManager[None]:
    """Use one style in all drawings, and fixed SVG identifiers, so that equal drawings have equal texts."""
    return mpl.rc_context(
        {"svg.hashsalt": "codra", "font.size": 9.5, "axes.spines.top": False, "axes.spines.right": False}
    )


def svg_of(figure: Figure) -> str:
    """Return a figure as an SVG document without a date."""
    text = StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue()
