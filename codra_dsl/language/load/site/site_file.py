"""Read the file of a site: the name of the spec that it changes, and its values by section and name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from codra_dsl.language.load.schema.document import read_root
from codra_dsl.language.load.schema.keys_and_values import explain_outline
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode
from codra_dsl.language.load.yaml.origin import Origin, Subject
from codra_dsl.language.load.yaml.source import AS_ON_DISK, Source, file_place, read

SITE_KEY = "overlays"
"""The key that makes a file a site."""


@dataclass(frozen=True, slots=True)
class SiteFile:
    """The file of a site.

    Attributes:
        spec_name: the name of the spec under `overlays`.
    """

    source: Source
    root: MappingNode
    spec_name: ScalarNode

    @property
    def origin(self) -> Origin:
        """The origin of the file's nodes."""
        return Origin(self.source)


def read_site_file(
    path: Path, file: str, root: Path, findings: Findings, texts: Mapping[str, bytes] = AS_ON_DISK
) -> SiteFile | None:
    """Return the file of a site, or None after a finding if it cannot be read as a site.

    Args:
        path: the file.
        file: the path relative to the root, as findings show it.
        root: the folder of the project.
        findings: where findings are added.
        texts: the contents of files that are not read from disk.
    """
    source = read(path, file, root, findings, texts)
    node = None if source is None else read_root(source, findings, SITE_KEY)
    if source is None or node is None:
        return None
    key = next(iter(node.entries.values()))[0]
    explain_outline("site", node, Subject("site", key, Origin(source)), findings)
    spec_name = node.value(SITE_KEY)
    if isinstance(spec_name, ScalarNode) and isinstance(spec_name.data, str):
        return SiteFile(source, node, spec_name)
    if spec_name is None:
        help_text = f"write '{SITE_KEY}: NAME' with the name of the spec that the site changes"
        findings.add("not-a-site", f"the file has no key '{SITE_KEY}'", file_place(file), help=help_text)
    return None
