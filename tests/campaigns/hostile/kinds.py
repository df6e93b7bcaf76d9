"""All kinds of hostile inputs, the fastest first."""

from __future__ import annotations

from collections.abc import Mapping

from tests.campaigns.hostile.engines import ENGINES
from tests.campaigns.hostile.graphs import DSR, GRAPHML
from tests.campaigns.hostile.reading import Kind
from tests.campaigns.hostile.trees import TREES

KINDS: Mapping[str, Kind] = {"fll": ENGINES, "trees": TREES, "dsr": DSR, "graphml": GRAPHML}
