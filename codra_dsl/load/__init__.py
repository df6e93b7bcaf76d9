"""Text -> (Spec | None, findings).

Reading goes by steps, and what one step found wrong silences later steps about that element only: bytes to text
(`source`), YAML events to nodes with positions (`compose`, `syntax`) through slips of punctuation (`mending`, `draft`),
a file's head (`document`), parts (`parts`), shape by schema.json (`schema`, `shape`), templates and their uses
(`templates`, `parameters`, `uses`, `fill`), elements (`elements`, `build`), and the modules that they call (`calls`,
`modules`).

Nothing here runs what a spec says, imports what it names, or reads outside the project's folder.
"""

from codra_dsl.load.discover import Files, find_files
from codra_dsl.load.rules import RULES
from codra_dsl.load.spec import STANDARD_INPUT, Loaded, load_spec, load_text

__all__ = ["RULES", "STANDARD_INPUT", "Files", "Loaded", "find_files", "load_spec", "load_text"]
