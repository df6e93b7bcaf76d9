"""Graphs of others: RoboComp's DSR as JSON, taken into a graph of ours and told from it, with nothing lost."""

from __future__ import annotations

from codra_dsl.runtime.exchange.document import DsrEdge, DsrGraph, DsrNode, DsrValue, ExchangeError, ValueCode
from codra_dsl.runtime.exchange.dsr_json import dsr_text, parse_dsr, read_dsr, write_dsr
from codra_dsl.runtime.exchange.start import Foreign, Start, begun_with
from codra_dsl.runtime.exchange.telling import dsr_of

__all__ = [
    "DsrEdge",
    "DsrGraph",
    "DsrNode",
    "DsrValue",
    "ExchangeError",
    "Foreign",
    "Start",
    "ValueCode",
    "begun_with",
    "dsr_of",
    "dsr_text",
    "parse_dsr",
    "read_dsr",
    "write_dsr",
]
