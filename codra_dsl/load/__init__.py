"""Text -> (Spec | None, findings).

Reading goes by steps, and what one step found wrong silences later steps about that element only: bytes to text
(`source`), YAML events to nodes with positions (`compose`, `syntax`), a file's head (`document`), parts (`parts`),
shape by schema.json (`shape`), templates and their uses (`templates`, `uses`, `fill`), elements (`elements`, `build`).

Nothing here runs what a spec says, imports what it names, or reads outside the project's folder.
"""

from codra_dsl.load.discover import spec_files
from codra_dsl.load.rules import RULES
from codra_dsl.load.spec import STANDARD_INPUT, Loaded, load_spec, load_text

__all__ = ["RULES", "STANDARD_INPUT", "Loaded", "load_spec", "load_text", "spec_files"]
