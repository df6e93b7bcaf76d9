"""Settings of the site that `make docs` builds with Sphinx from the pages of this repository.

A link to a missing page or anchor stops the build.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

PARTS = {
    "Tutorial": "docs/tutorial/*",
    "How-to guides": "docs/how-to/*",
    "Reference": "docs/reference/*",
    "Explanation": "docs/explanation/*",
    "The papers": "docs/papers/*",
    "For contributors": "[A-Z]*",
}
"""The pages of each part of the contents, by caption."""

project = "CoDRA DSL"
extensions = ["myst_parser"]
root_doc = "README"
include_patterns = ["*.md", "docs/**/*.md", "codra_dsl/tooling/report/pages/*.md"]
nitpicky = True
suppress_warnings = [
    "misc.highlighting_failure",  # some blocks have no lexer, and some are invalid on purpose
    "toc.not_included",  # the pages of findings are reached from their list and by the search
]
myst_heading_anchors = 6
html_theme = "furo"
html_title = project
html_copy_source = False
html_use_index = False
html_show_copyright = False
html_show_sphinx = False


def _append_contents(_: "Sphinx", page: str, texts: list[str]) -> None:
    """Append the contents of the site to its first page, so that the file itself has no words of the generator."""
    if page == root_doc:
        for caption, pages in PARTS.items():
            texts[0] += f"\n```{{toctree}}\n:hidden:\n:glob:\n:caption: {caption}\n\n{pages}\n```\n"


def setup(app: "Sphinx") -> None:
    """Connect the function above."""
    app.connect("source-read", _append_contents)
