"""Read the parts that a spec includes: each part once, and only from inside the project."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path, PurePosixPath

from codra_dsl.language.diagnostics import Place, Related
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.file_queries import file_size, folder_names, is_file, real_path
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.load.schema.document import Document, read_document
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.language.load.yaml.nodes import ScalarNode
from codra_dsl.language.load.yaml.source import AS_ON_DISK, MAX_BYTES, read

MAX_PARTS = 1000
MAX_INCLUDE_DEPTH = 16
_MAX_LISTED = 2000
_PART_NAME = r".*\.ya?ml"


@dataclass(frozen=True, slots=True)
class _IncludingFile:
    """A file whose parts are being read.

    `include_chain` has the files from the spec to this file; each of them includes the next one.
    """

    path: Path
    include_chain: tuple[Path, ...]


class Parts:
    """Reads a spec's parts.

    Attributes:
        documents: the documents: first the spec itself, then parts in the order of inclusion.
        is_complete: whether every part could be read.
        are_too_large: whether the parts have more bytes than are allowed. Then the spec cannot be read.
    """

    def __init__(self, root: Path, findings: Findings, texts: Mapping[str, bytes] = AS_ON_DISK) -> None:
        """Initialize. `texts` has the content of files that are not read from disk.

        The keys of `texts` are the names that findings show for these files.
        """
        self.documents: list[Document] = []
        self.is_complete = True
        self.are_too_large = False
        self._root = real_path(root)
        self._findings = findings
        self._texts = texts
        self._first_places: dict[Path, Place] = {}
        self._weighed_paths: set[Path] = set()
        self._size_bytes = 0
        self._include_count = 0

    def read_all(self, document: Document, path: Path) -> None:
        """Read a document's parts, recursively."""
        self._first_places[path] = document.origin.of(document.subject.key)
        self._weighed_paths.add(path)
        self._size_bytes = len(document.origin.source.text)
        self._add(document, _IncludingFile(path, (path,)))

    def _add(self, document: Document, open_file: _IncludingFile) -> None:
        self.documents.append(document)
        self._weigh(document, open_file)
        for node in document.includes:
            if self.are_too_large:
                break
            if node.reported or not self._include(document, node, open_file):
                self.is_complete = False
            if self._include_count > MAX_PARTS:  # already reported; every further include would cause a finding
                break

    def _weigh(self, document: Document, open_file: _IncludingFile) -> None:
        """Add up the sizes of the parts that a document includes, before any of them is read; report a size too large.

        Reading parts of this size takes a minute, and seeing it a millisecond.
        """
        for node in document.includes[:MAX_PARTS]:
            with suppress(OSError, RuntimeError, ValueError):  # such a part is reported when it is located
                self._weigh_part(real_path(open_file.path.parent / node.text))
            if self._size_bytes > MAX_BYTES:
                self.are_too_large, self.is_complete = True, False
                self._report_too_many_parts(document.origin.of(node))
                return

    def _weigh_part(self, path: Path) -> None:
        if path in self._weighed_paths or not path.is_relative_to(self._root):
            return
        self._weighed_paths.add(path)
        size_bytes = file_size(path, path.relative_to(self._root).as_posix(), self._texts)
        self._size_bytes += size_bytes if size_bytes <= MAX_BYTES else 0  # a part that is too large is not read

    def _include(self, document: Document, node: ScalarNode, open_file: _IncludingFile) -> bool:
        """Read one part; return whether its elements are known."""
        place = document.origin.of(node)
        self._include_count += 1
        if self._include_count > MAX_PARTS:
            self._report_too_many_parts(place)
            return False
        path = self._locate(node, open_file, place)
        if path is None or not self._is_first(path, node, open_file, place):
            return path is not None and path in self._first_places and path not in open_file.include_chain
        if len(self.documents) > MAX_PARTS or len(open_file.include_chain) > MAX_INCLUDE_DEPTH:
            self._report_too_many_parts(place)
            return False
        self._first_places[path] = place
        file = path.relative_to(self._root).as_posix()
        source = read(path, file, self._root, self._findings, self._texts)
        part = None if source is None else read_document(source, self._findings)
        if part is None:
            return False
        if part.name is not None:
            related = Related("this name makes it a spec", part.origin.of(part.name))
            self._refuse("part-is-spec", f"{shown(node.text)} is a spec", place, "include parts only", related)
            return False
        self._add(part, _IncludingFile(path, (*open_file.include_chain, path)))
        return True

    def _report_too_many_parts(self, place: Place) -> None:
        help_text = (
            f"at most {MAX_PARTS} parts are read, with {MAX_BYTES >> 20} MiB in all;"
            f" includes are nested at most {MAX_INCLUDE_DEPTH} deep"
        )
        self._findings.add("too-many-parts", "the spec has too many parts", place, help=help_text, path="include")

    def _locate(self, node: ScalarNode, open_file: _IncludingFile, place: Place) -> Path | None:
        """Return the file that an include names, with links resolved.

        Report a missing or forbidden file and return None.
        """
        text = node.text
        if text.startswith(("/", "~")) or "\\" in text or Path(text).is_absolute():
            help_text = "write a relative path with '/'"
            self._refuse("part-outside-project", f"{shown(text)} is not a relative path", place, help_text)
            return None
        try:
            path = real_path(open_file.path.parent / text)
            is_inside, is_readable = path.is_relative_to(self._root), is_file(path) or self._is_unsaved(path)
        except (OSError, RuntimeError, ValueError):
            is_inside, is_readable, path = True, False, open_file.path
        if not is_inside:
            folder_definition = (
                "the nearest folder upwards whose pyproject.toml has [tool.codra], else the spec's own folder"
            )
            help_text = (
                f"parts must be in the project's folder {shown(self._root.name)} or below (it is {folder_definition})"
            )
            self._refuse("part-outside-project", f"{shown(text)} is outside of the project", place, help_text)
        elif not is_readable:
            self._refuse(
                "part-not-found", f"there is no file {shown(text)}", place, self._suggestion_help(open_file.path, text)
            )
        return path if is_inside and is_readable else None

    def _is_unsaved(self, path: Path) -> bool:
        """Return whether a part is only in `texts`. An earlier result depends on this by the part's size."""
        return path.is_relative_to(self._root) and path.relative_to(self._root).as_posix() in self._texts

    def _is_first(self, path: Path, node: ScalarNode, open_file: _IncludingFile, place: Place) -> bool:
        first = self._first_places.get(path)
        if first is None:
            return True
        if path in open_file.include_chain:
            chain = " -> ".join(
                [*(step.name for step in open_file.include_chain[open_file.include_chain.index(path) :]), path.name]
            )
            help_text = "remove one of these includes"
            self._refuse("part-includes-itself", f"{shown(node.text)} includes itself: {chain}", place, help_text)
        else:
            message = f"{shown(node.text)} is included twice"
            related = Related("first included here", first)
            self._refuse("part-included-twice", message, place, "remove one of them", related)
        return False

    def _suggestion_help(self, including_file: Path, text: str) -> str:
        folder = (including_file.parent / text).parent
        try:
            names = sorted(folder_names(folder, _MAX_LISTED, _PART_NAME))
        except (OSError, ValueError):
            return "paths are relative to this file"
        suggestion = self._findings.nearest(Path(text).name, names)
        return (
            f"did you mean '{PurePosixPath(text).with_name(suggestion)}'?"
            if suggestion
            else "paths are relative to this file"
        )

    def _refuse(self, rule: str, message: str, place: Place, help_text: str, *related: Related) -> None:
        self._findings.add(rule, message, place, help=help_text, path="include", related=related)
