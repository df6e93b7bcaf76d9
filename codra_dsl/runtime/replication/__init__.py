"""Replicas of the knowledge graph on several machines, which converge (P2, section 7)."""

from __future__ import annotations

from codra_dsl.runtime.replication.commits import Commit
from codra_dsl.runtime.replication.operation_journal import OperationFile, OperationJournal
from codra_dsl.runtime.replication.replica import NotJoinedError, Replica

__all__ = ["Commit", "NotJoinedError", "OperationFile", "OperationJournal", "Replica"]
