"""Decisions in the journal: closed schemas, replay, and `why` the morning after."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema

from codra_dsl.runtime import ContextManager, Journal, Kind
from codra_dsl.runtime.journal.encoding import message_of
from codra_dsl.runtime.journal.past import Past
from codra_dsl.runtime.journal.reading import JournalReader
from codra_dsl.runtime.journal.schemas import schema_of
from codra_dsl.runtime.replay import replay
from codra_dsl.runtime.why import explain
from tests.runtime.mape.shop import KNOWLEDGE, MODEL, Shop
from tests.runtime.mape.test_loop import CLOSE_M
