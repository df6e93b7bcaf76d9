"""Metrics and weights over time, from the events of a run (P2, Figures 11 and 12)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from codra_dsl.runtime.journal import Event, Kind

Curve = list[tuple[float, float]]

_CHOSEN = "chosen"

_COLOURS = ("#0072b2", "#009e73", "#e69f00", "#cc79a7", "#56b4e9", "#d55e00")
"""The colours of curves, by Okabe and Ito: readers with any colour vision can distinguish them."""

_MOST_WIDTH, _LEAST_WIDTH = 6.0, 1.4
"""Each curve is narrower than the previous one, which therefore shows on both sides where curves coincide."""


def draw_adaptation(path: Path, events: Iterable[Event], metrics: Iterable[str], weights: Iterable[str]) -> None:
    """Draw metrics, weights, and the instants at which an action was chosen.

    Args:
        path: the file of the picture; its suffix (`.png`, `.svg`) selects the format.
        events: the events of a run, in order.
        metrics: the context-variables that the upper half shows.
        weights: the context-variables that the lower half shows.
    """
    run_events = list(events)
    choices = [(event.instant_s, str(event.details["action"])) for event in run_events if event.what == _CHOSEN]
    figure = Figure(figsize=(10, 6), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    _draw(upper, curves(run_events, metrics), "metrics")
    _draw(lower, curves(run_events, weights), "weights of actions")
    for axes in (upper, lower):
        for instant_s, _ in choices:
            axes.axvline(instant_s, color="#5a6b75", linewidth=0.8, linestyle=":")
    for index, (instant_s, action) in enumerate(choices):
        upper.annotate(action, (instant_s, 1.03 + 0.09 * (index % 3)), fontsize=8, annotation_clip=False)
    lower.set_xlabel("time in s; dotted lines: an action is chosen as the course")
    figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None)


def curves(events: Iterable[Event], names: Iterable[str]) -> Mapping[str, Curve]:
    """Return the values of each variable, as pairs of an instant and a value; an unknown value is NaN."""
    values: dict[str, Curve] = {name: [] for name in names}
    for event in events:
        if event.kind is Kind.VARIABLE and event.name in values:
            value = event.details.get("value")
            number = float(value) if isinstance(value, (int, float)) else float("nan")
            values[event.name].append((event.instant_s, number))
    return values


def _draw(axes: Axes, curve_by_name: Mapping[str, Curve], title: str) -> None:
    narrowing = (_MOST_WIDTH - _LEAST_WIDTH) / max(len(curve_by_name) - 1, 1)
    for index, (name, curve) in enumerate(curve_by_name.items()):
        if curve:
            axes.step(
                *zip(*curve, strict=True),
                where="post",
                label=name.removeprefix("weight_of_"),
                color=_COLOURS[index % len(_COLOURS)],
                linewidth=_MOST_WIDTH - index * narrowing,
            )
    axes.set_ylim(0.0, 1.0)
    axes.set_ylabel(title)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)  # beside the curves, not on them
