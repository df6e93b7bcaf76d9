"""Stored results of earlier runs and of single specs. A result is used again if nothing has changed since.

A run is stored under its command and paths. It contains the answers to all queries about files on which the result
depends: the bytes of the specs, of their parts, trees and modules, and of the project's settings, links, and files that
do not exist. If a run is out of date, the stored results of those specs are used whose own queries have the same
answers as before; only other specs are compiled again. Each stored file states the version of codra, its libraries and
Python. The cache holds only data, which is signed with a secret of the user. Entries that cannot be read, that somebody
else or another version wrote are ignored.
"""

from codra_dsl.workspace.cache.runs import Cache, Run, cache_of
from codra_dsl.workspace.cache.spec_results import SpecResult, SpecResults, result_key
from codra_dsl.workspace.cache.stored_files import FOLDER

__all__ = ["FOLDER", "Cache", "Run", "SpecResult", "SpecResults", "cache_of", "result_key"]
