"""Load a complete spec: its file, its parts and its uses, as one value."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from codra_dsl.collector import paused_collector
from codra_dsl.language.diagnostics import Diagnostic, has_errors, in_file_order, once_per_template
from codra_dsl.language.expression import MAX_NAME, is_identifier
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.file_queries import real_path
from codra_dsl.language.load.calls import DeclaredNames, check_calls
from codra_dsl.language.load.elements.elements import Elements
from codra_dsl.language.load.elements.handles import report_handles_of_slots, take_handles
from codra_dsl.language.load.instantiation import Uses
from codra_dsl.language.load.loop_variables import with_loop_variables
from codra_dsl.language.load.parts import Parts
from codra_dsl.language.load.pose_conditions import with_pose_conditions
from codra_dsl.language.load.schema.document import SECTIONS, Document, read_document, take_section
from codra_dsl.language.load.site.overlay import Overlay
from codra_dsl.language.load.site.site_file import SiteFile, read_site_file
from codra_dsl.language.load.topics import check_topics
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.language.load.yaml.nodes import ScalarNode
from codra_dsl.language.load.yaml.origin import Origin
from codra_dsl.language.load.yaml.reader import entries
from codra_dsl.language.load.yaml.source import AS_ON_DISK, Source, accept, decode, read
from codra_dsl.language.model import AnyName, Handle, Site, Spec

STANDARD_INPUT = "-"

Loaded = tuple[Spec | None, tuple[Diagnostic, ...]]
"""A spec and its findings, in file order. The spec is None if its file cannot be read as a spec, or has no name."""


@paused_collector()
def load_spec(path: Path, root: Path, texts: Mapping[str, bytes] = AS_ON_DISK, site: Path | None = None) -> Loaded:
    """Return the spec in a file, with its parts.

    Args:
        path: the file.
        root: the project's folder: findings name files relative to this folder, and parts must be inside it.
        texts: the contents of files that are not read from disk, by their paths relative to `root`.
        site: the file of a site, whose values replace those of the spec; None for the spec itself.

    Raises:
        ValueError: if a file is not in the project.
    """
    findings = Findings()
    site_file = None if site is None else read_site_file(site, _relative_path(site, root), root, findings, texts)
    if site is not None and site_file is None:
        return None, _sorted_diagnostics(findings)
    source = read(path, _relative_path(path, root), root, findings, texts)
    return _load(source, path, root, findings, texts, site_file=site_file)


@paused_collector()
def load_text(text: str | bytes, file: str, root: Path) -> Loaded:
    """Return the spec in a text, with its parts. In findings, the text has the name `file`: `-` for standard input.

    `root` is the project's folder. The paths of the parts that a spec from standard input includes are relative to this
    folder.
    """
    findings = Findings()
    source = decode(text, file, findings) if isinstance(text, bytes) else accept(text, file, findings)
    return _load(source, root / (file if file != STANDARD_INPUT else "standard input"), root, findings)


def _relative_path(path: Path, root: Path) -> str:
    try:
        return Path(os.path.normpath(path.absolute())).relative_to(os.path.normpath(root.absolute())).as_posix()
    except ValueError:
        return real_path(path).relative_to(real_path(root)).as_posix()


def _load(
    source: Source | None,
    path: Path,
    root: Path,
    findings: Findings,
    texts: Mapping[str, bytes] = AS_ON_DISK,
    *,
    site_file: SiteFile | None = None,
) -> Loaded:
    document = None if source is None else read_document(source, findings)
    if document is None:
        return None, _sorted_diagnostics(findings)
    name = document.name
    if name is None and not document.may_be_named:
        help_text = "give the path of the spec that includes it, or add a 'name'"
        message = f"{shown(document.origin.source.file)} is a part: it has no 'name'"
        findings.add("part-without-spec", message, document.origin.of(document.subject.key), help=help_text)
    parts = Parts(root, findings, texts)
    parts.read_all(document, real_path(path))
    if parts.are_too_large:
        return None, _sorted_diagnostics(findings)
    spec = _read_spec(document, name, parts, root, findings, site_file=site_file)
    return spec, _sorted_diagnostics(findings)


def _sorted_diagnostics(findings: Findings) -> tuple[Diagnostic, ...]:
    return in_file_order(once_per_template(findings.all()))


def _read_spec(
    document: Document,
    name: ScalarNode | None,
    parts: Parts,
    root: Path,
    findings: Findings,
    *,
    site_file: SiteFile | None,
) -> Spec | None:
    handles = () if site_file is None else tuple(take_handles(site_file, findings))
    overlay = None if site_file is None else Overlay(site_file, findings)
    lost_sections = frozenset[str]().union(*(part.lost_sections for part in parts.documents))
    elements = Elements(findings, overlay)
    uses = Uses(findings, overlay, may_lack_templates=bool(lost_sections) or not parts.is_complete)
    module_names = _module_names(parts.documents)
    uses.declare(parts.documents)
    for part in parts.documents:
        origin = Origin(part.origin.source, module=module_names[part.origin.source.file])
        for section in SECTIONS:
            elements.add(section, take_section(part.root, section), origin)  # removed, so that its nodes can be freed
    uses.create_elements(parts.documents, module_names, elements)
    uses.try_unused_templates()
    elements.report_comments()
    resources = elements.elements_by_section["resources"]
    report_handles_of_slots(handles, resources, findings)
    if name is None:
        return None
    module_files = check_calls(
        elements.elements_by_section["perception"].values(),
        [handle for handle in handles if handle.resource in resources and resources[handle.resource].slots is None],
        _declared_names(elements),
        root,
        findings,
    )
    message_files = check_topics(elements.elements_by_section["context"].values(), root, findings)
    damaged_names = _damaged_names(
        elements, lost_sections if uses.is_complete and parts.is_complete else frozenset(SECTIONS)
    )
    site = None if overlay is None else _site(overlay, handles, parts, elements, damaged_names)
    if has_errors(findings.all()):
        damaged_names["spec"] = frozenset({name.text})
    elements_by_section = {
        section: tuple(section_elements.values()) for section, section_elements in elements.elements_by_section.items()
    }
    spec = Spec(
        name=name.text,
        place=document.origin.of(name),
        file=document.origin.source.file,
        files=(*(part.origin.source.file for part in parts.documents), *([] if site is None else [site.file])),
        site=site,
        modules=(*module_files, *message_files),
        **elements_by_section,
        uses=tuple(uses.valid_uses),
        templates=tuple(uses.declared_templates()),
        origins=elements.origins,
        damaged=damaged_names,
        damaged_keys=elements.damaged_keys,
    )
    return with_pose_conditions(with_loop_variables(spec, findings))


def _site(
    overlay: Overlay,
    handles: tuple[Handle, ...],
    parts: Parts,
    elements: Elements,
    damaged_names: Mapping[str, frozenset[str]],
) -> Site:
    """Return the values that a site states; report the names in it that the spec does not have."""
    names_by_section = {section: [*names] for section, names in elements.elements_by_section.items()}
    names_by_section["use"] = [key.text for part in parts.documents for key, _ in entries(part.section("use"))]
    overlay.report_unknown_names(parts.documents[0].subject, names_by_section, damaged_names)
    site_file = overlay.site
    return Site(
        file=site_file.source.file,
        place=site_file.origin.of(site_file.spec_name),
        replacements=tuple(sorted(overlay.replacements, key=lambda value: value.place)),
        handles=handles,
    )


def _declared_names(elements: Elements) -> DeclaredNames:
    resources, context = (frozenset(elements.elements_by_section[section]) for section in ("resources", "context"))
    return DeclaredNames(resources, context, elements.damaged_keys)


def _damaged_names(elements: Elements, sections: Iterable[str]) -> dict[str, frozenset[str]]:
    lost_sections = frozenset(sections)
    return {
        section: AnyName(names) if section in lost_sections else frozenset(names)
        for section, names in elements.damaged.items()
    }


def _module_names(documents: Iterable[Document]) -> dict[str, str]:
    """Return a mapping from the name of each use and the path of each file to the name of its generated module.

    The names are identifiers, and unique without regard to case. The module of a use has the name of the use. The
    module of a file is named after the file's stem; if this name is taken, after the file's path; if this name is taken
    as well, after the stem with a number.
    """
    module_names: dict[str, str] = {}
    taken_names: set[str] = set()
    for document in documents:
        for key, _ in entries(document.section("use")):
            module_names.setdefault(key.text, key.text)
            taken_names.add(key.text.casefold())
    for document in documents:
        path = Path(document.origin.source.file).with_suffix("")
        preferred_names = [_identifier(path.name), _identifier("_".join(path.parts))]
        numbered_names = (f"{preferred_names[0]}_{number}" for number in range(2, len(taken_names) + 3))
        free_name = next(
            candidate for candidate in (*preferred_names, *numbered_names) if candidate.casefold() not in taken_names
        )
        module_names[document.origin.source.file] = free_name
        taken_names.add(free_name.casefold())
    return module_names


def _identifier(text: str) -> str:
    """Return a file's name as an identifier. A name without a letter or digit, such as `-`, becomes `spec`."""
    name = re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_")[:MAX_NAME] or "spec"
    return name if is_identifier(name) else f"spec_{name}"[:MAX_NAME]
