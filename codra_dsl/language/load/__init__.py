"""Text -> (Spec | None, findings).

A spec is read in steps. A finding of one step suppresses later findings about the same element only. The steps are:
bytes to nodes with positions, with punctuation repaired where possible (`yaml`); the shape by `schema.json` (`schema`);
parts (`parts`); templates and their uses (`templates`, `instantiation`); elements (`elements`); and the modules that
they call (`calls`, `modules`).

This package never executes the content of a spec, imports the modules that it names, or reads outside the project's
folder.
"""

from codra_dsl.language.load.discover import Files, find_files
from codra_dsl.language.load.spec import STANDARD_INPUT, Loaded, load_spec, load_text
from codra_dsl.language.load.yaml.rules import RULES

__all__ = ["RULES", "STANDARD_INPUT", "Files", "Loaded", "find_files", "load_spec", "load_text"]
