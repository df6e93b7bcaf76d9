"""All kinds of hostile inputs, the fastest first."""

from __future__ import annotations

from collections.abc import Mapping

from tests.campaigns.hostile.engines import ENGINES
from tests.campaigns.hostile.graphs import DSR, GRAPHML
from tests.campaigns.hostile.journals import JOURNALS
from tests.campaigns.hostile.names import NAMES_KIND
from tests.campaigns.hostile.reading import Kind
from tests.campaigns.hostile.repositories import REPOSITORIES
from tests.campaigns.hostile.settings import SETTINGS
from tests.campaigns.hostile.single_files import SINGLE_FILES
from tests.campaigns.hostile.sources import SOURCES
from tests.campaigns.hostile.specs import SPECS
from tests.campaigns.hostile.trees import TREES

KINDS: Mapping[str, Kind] = {
    "fll": ENGINES,
    "trees": TREES,
    "dsr": DSR,
    "graphml": GRAPHML,
    "mcap": JOURNALS,
    "settings": SETTINGS,
    "files": SINGLE_FILES,
    "names": NAMES_KIND,
    "sources": SOURCES,
    "specs": SPECS,
    "git": REPOSITORIES,
}
