"""Memory of the language server over 10,000 edits of a spec of 2,000 lines: `python benchmarks/editor_memory.py [EDITS]`.

Each edit changes one angle by one message, as a keystroke does; every hundredth edit breaks the file, and the next one
mends it. Each edit is answered by findings before the next one is made. It prints the memory of the process.
"""

from __future__ import annotations

import asyncio
import re
import sys
import tempfile
import time
from pathlib import Path

from forests import flat, write
from lsprotocol import types
from pygls.lsp.client import BaseLanguageClient

VARIABLE_COUNT = 250
SAMPLES = 20
SERVER = (sys.executable, "-m", "codra_dsl", "language-server")

_ANGLE = re.compile(r"angle > 0\.([0-9]+) rad")
