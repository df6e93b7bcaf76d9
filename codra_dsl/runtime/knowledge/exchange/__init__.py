"""Import and export of graphs in the JSON format of RoboComp's DSR, without loss."""

from __future__ import annotations

from codra_dsl.runtime.knowledge.exchange.document import DsrEdge, DsrGraph, DsrNode, DsrValue, ExchangeError, ValueCode
from codra_dsl.runtime.knowledge.exchange.dsr_json import dsr_text, parse_dsr, read_dsr, write_dsr
from codra_dsl.runtime.knowledge.exchange.export import export_dsr
from codra_dsl.runtime.knowledge.exchange.import_ import DsrImport, SkippedPart, import_dsr

__all__ = [
    "DsrEdge",
    "DsrGraph",
    "DsrImport",
    "DsrNode",
    "DsrValue",
    "ExchangeError",
    "SkippedPart",
    "ValueCode",
    "dsr_text",
    "export_dsr",
    "import_dsr",
    "parse_dsr",
    "read_dsr",
    "write_dsr",
]
