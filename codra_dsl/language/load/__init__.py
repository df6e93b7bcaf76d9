"""Read a spec: text -> (Spec | None, findings).

A finding of one step suppresses findings of later steps about the same element. A spec is read in these steps:

- `yaml` converts bytes to nodes with positions, and repairs punctuation where possible;
- `schema` compares the shape of the nodes with `schema.json`;
- `parts` reads the parts that the spec includes;
- `templates` and `instantiation` read templates and their uses;
- `site` replaces the values that differ on one site;
- `elements` builds the elements;
- `calls` and `called_modules` check the functions that the elements call.

This package never executes the content of a spec, never imports the modules that a spec names, and never reads files
outside the project's folder.
"""

from codra_dsl.language.load.discover import Files, find_files
from codra_dsl.language.load.spec import STANDARD_INPUT, Loaded, load_spec, load_text
from codra_dsl.language.load.yaml.rules import RULES

__all__ = ["RULES", "STANDARD_INPUT", "Files", "Loaded", "find_files", "load_spec", "load_text"]
