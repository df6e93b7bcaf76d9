"""The files of sites: each has the name of the spec that it changes, and values by section and name."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from codra_dsl.language.diagnostics import Diagnostic, Place, Related, suggest
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.load.schema.document import read_root
from codra_dsl.language.load.schema.keys_and_values import explain_outline
from codra_dsl.language.load.yaml.findings import Findings, list_names
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode
from codra_dsl.language.load.yaml.origin import Origin, Subject
from codra_dsl.language.load.yaml.rules import RULES
from codra_dsl.language.load.yaml.source import AS_ON_DISK, Source, file_place, read
from codra_dsl.language.project import relative_path

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


@dataclass(frozen=True, slots=True, kw_only=True)
class RequestedSite:
    """A site whose file can be read.

    Attributes:
        place: the place of the spec's name under `overlays`.
    """

    path: Path
    place: Place


RequestedSites = Mapping[str, Sequence[RequestedSite]]
"""Sites by the name of the spec that they change."""


def find_sites(
    paths: Iterable[Path], root: Path, texts: Mapping[str, bytes], *, one_for_each_spec: bool
) -> tuple[RequestedSites, tuple[Diagnostic, ...]]:
    """Return the sites in some files, and the findings about files that cannot be read as sites.

    `texts` has contents that are not read from disk. If `one_for_each_spec` is true, a second site for the same spec is
    reported and left out.
    """
    findings = Findings()
    sites: dict[str, list[RequestedSite]] = {}
    for path in paths:
        file_findings = Findings()
        site_file = read_site_file(path, relative_path(path, root), root, file_findings, texts)
        if site_file is None:
            findings.extend(file_findings)
            continue  # other findings about the file are reported when it is read together with its spec
        name, place = site_file.spec_name.text, site_file.origin.of(site_file.spec_name)
        sites_of_spec = sites.setdefault(name, [])
        if one_for_each_spec and sites_of_spec:
            message = f"spec {shown(name)} has two sites"
            related = [Related("the other site", sites_of_spec[0].place)]
            help_text = "compile the spec for one site at a time"
            findings.add("two-sites", message, place, help=help_text, path="overlays", related=related)
        else:
            sites_of_spec.append(RequestedSite(path=path, place=place))
    return sites, findings.all()


def sites_without_spec(sites: RequestedSites, spec_names: Iterable[str | None]) -> Iterator[Diagnostic]:
    """Yield a finding for each site whose spec is not among those with the given names.

    If one of the names is None, a spec has no readable name; then nothing is reported.
    """
    known_names = set(spec_names)
    names = sorted(name for name in known_names if name is not None)
    for name in () if None in known_names else sites:
        if name in known_names:
            continue
        suggestion = suggest(name, names)
        help_text = f"did you mean '{suggestion}'?" if suggestion else _paths_help(names)
        for site in sites[name]:
            message = f"there is no spec {shown(name)} at or below the given paths"
            yield Diagnostic(
                rule=RULES["site-without-spec"], message=message, place=site.place, path="overlays", help=help_text
            )


def _paths_help(names: Sequence[str]) -> str:
    help_text = "give the path of the spec as well"
    return f"{help_text}; the specs there are {list_names(names)}" if names else help_text
