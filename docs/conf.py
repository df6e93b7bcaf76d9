"""Settings of the documentation's site, which `make docs` builds with Sphinx. A repository browser reads the same pages.

A link to a missing page or anchor stops the build.
"""

from pathlib import Path
from typing import TYPE_CHECKING

from pygments.lexers.special import TextLexer

if TYPE_CHECKING:
    from docutils.nodes import Node, TextElement
    from sphinx.addnodes import pending_xref
    from sphinx.application import Sphinx
    from sphinx.environment import BuildEnvironment

project = "CoDRA DSL"
extensions = ["myst_parser"]
root_doc = "README"
include_patterns = ["*.md", "docs/**/*.md", "codra_dsl/tooling/report/pages/*.md"]
nitpicky = True
myst_heading_anchors = 6
html_theme = "furo"
html_title = project
html_copy_source = False
html_use_index = False
html_show_sphinx = False

CONTENTS = {
    "README": {
        "Tutorial": "/docs/tutorial/*",
        "How-to guides": "/docs/how-to/*",
        "Reference": "/docs/reference/*",
        "Explanation": "/docs/explanation/*",
        "The papers": "/docs/papers/*",
        "For contributors": "/[A-Z]*",
    },
    "docs/reference/findings": {"Findings": "/codra_dsl/tooling/report/pages/*"},
}
"""The pages below a page, by caption."""


def _append_contents(_: "Sphinx", page: str, texts: list[str]) -> None:
    """Append the contents of the site to a page, so that the file itself has no words of the generator."""
    for caption, pages in CONTENTS.get(page, {}).items():
        texts[0] += f"\n```{{toctree}}\n:hidden:\n:glob:\n:caption: {caption}\n\n{pages}\n```\n"


def _keep_text_of_folder(
    _: "Sphinx", environment: "BuildEnvironment", link: "pending_xref", text: "TextElement"
) -> "Node | None":
    """Show only the text of a link to a folder of the repository, because the site has no page of the folder."""
    page = Path(environment.doc2path(link["refdoc"]))
    return text if (page.parent / link["reftarget"]).is_dir() else None


def setup(app: "Sphinx") -> None:
    """Connect the functions above."""
    app.connect("source-read", _append_contents)
    app.connect("missing-reference", _keep_text_of_folder)
    app.add_lexer("mermaid", TextLexer)
