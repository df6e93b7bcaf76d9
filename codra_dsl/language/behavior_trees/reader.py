"""Read a file of BehaviorTree.CPP and its included files: elements -> tree values, with a check of the shape."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from codra_dsl.language.behavior_trees.catalogue import POST_SCRIPTS, PRECONDITIONS
from codra_dsl.language.behavior_trees.elements import MAX_ATTRIBUTES, Element, read_root
from codra_dsl.language.behavior_trees.rules import TreeFindings
from codra_dsl.language.behavior_trees.values import (
    Attribute,
    BehaviorTree,
    Direction,
    Forest,
    Include,
    NodeKind,
    NodeModel,
    Port,
    TreeFile,
    TreeNode,
)
from codra_dsl.language.behavior_trees.version3 import convert_from_version_3, is_of_version_3
from codra_dsl.language.diagnostics import Diagnostic, Place
from codra_dsl.language.file_queries import is_file, leads_into, real_path
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.language.load.yaml.source import Source, decode
from codra_dsl.language.load.yaml.source import read as read_source
from codra_dsl.language.project import relative_path

FORMAT = "4"
OLD_FORMAT = "3"
MAX_FILES = 100
UNNAMED_TREE = "BehaviorTree_0"
"""The id of a tree without ID; the library gives it the same name."""

_MODELS_TAG = "TreeNodesModel"
_METADATA_TAG = "MetadataFields"
_DIRECTIONS = {**{direction.value: direction for direction in Direction}, "bidirectional_port": Direction.BOTH}
"""The directions by the tags of ports. The node list of Nav2 has `bidirectional_port`."""

_EXPLICIT_TAGS = frozenset(kind.value for kind in NodeKind)
_CONDITION_ATTRIBUTES = frozenset({*PRECONDITIONS, *POST_SCRIPTS})


def read(path: Path, root: Path, within: Path | None = None) -> tuple[Forest | None, tuple[Diagnostic, ...]]:
    """Return the trees of a file and its included files, or None if one of these cannot be read; and the findings.

    Args:
        path: the path of the file.
        root: the folder of the project. Paths in places are relative to this folder.
        within: the folder outside of which no file is read; by default the folder of the project.
    """
    findings, within = TreeFindings(), root if within is None else within
    files: dict[Path, TreeFile | None] = {}
    pending: list[tuple[Path, Place | None]] = [(path, None)]
    while pending:
        current_path, include_place = pending.pop(0)
        followed_path = real_path(current_path)
        if followed_path in files:
            continue
        if len(files) == MAX_FILES and include_place is not None:
            findings.add("tree-include", f"more than {MAX_FILES} files", include_place, help="include fewer")
            break
        files[followed_path] = file = _read_file(current_path, root, within, findings)
        pending += [] if file is None else _included_files(file, current_path, within, findings)
    readable_files = [file for file in files.values() if file is not None]
    return (Forest(files=tuple(readable_files)) if len(readable_files) == len(files) else None), findings.all()


def read_text(data: bytes, file: str) -> tuple[TreeFile | None, tuple[Diagnostic, ...]]:
    """Return the trees in the bytes of one file, without the files that it includes; and the findings."""
    findings, source_findings = TreeFindings(), Findings()
    source = decode(data, file, source_findings)
    findings.extend(source_findings.all())
    return (None if source is None else _read_source(source, findings)), findings.all()


def _read_file(path: Path, root: Path, within: Path, findings: TreeFindings) -> TreeFile | None:
    source_findings = Findings()
    source = read_source(path, relative_path(path, root), within, source_findings, texts=None)
    findings.extend(source_findings.all())
    return None if source is None else _read_source(source, findings)


def _included_files(
    file: TreeFile, path: Path, root: Path, findings: TreeFindings
) -> Iterable[tuple[Path, Place | None]]:
    """Yield the files that a file includes, if they are in the project."""
    for include in file.includes:
        included_path = path.parent / include.path
        is_inside_project = leads_into(included_path, root)
        if Path(include.path).is_absolute() or not is_inside_project:
            findings.add(
                "tree-include",
                f"'{include.path}' is outside of the project",
                include.place,
                help="include files of the project, by a path relative to this file",
            )
        elif not is_file(included_path):
            findings.add("tree-include", f"there is no file '{include.path}'", include.place, help="correct the path")
        else:
            yield included_path, include.place


def _read_source(source: Source, findings: TreeFindings) -> TreeFile | None:
    root = read_root(source, findings)
    return None if root is None else _FileBuilder(source.file, findings).file(root)


class _FileBuilder:
    """Converts the elements of one file to values."""

    def __init__(self, file: str, findings: TreeFindings) -> None:
        self._file = file
        self._findings = findings
        self._is_single_tree = False

    def file(self, root: Element) -> TreeFile | None:
        """Return the file as a value, or None if it is not a file of trees, or none of its trees can be read."""
        if not self._check_format(root):
            return None
        main = root.get("main_tree_to_execute")
        tree_count = sum(child.tag == "BehaviorTree" for child in root.children)
        self._is_single_tree = tree_count == 1
        children = [(child.tag, child) for child in root.children]
        known_tags = ("BehaviorTree", _MODELS_TAG, "include")
        for tag, child in children:
            if tag not in known_tags:
                self._report_misplaced_element(child, "<root>", known_tags)
        trees = [tree for tag, child in children if tag == "BehaviorTree" and (tree := self._tree(child)) is not None]
        models = (model for tag, child in children if tag == _MODELS_TAG for model in self._models(child))
        includes = (self._include(child) for tag, child in children if tag == "include")
        comments = [comment for tag, child in children if tag != "BehaviorTree" for comment in _all_comments(child)]
        if tree_count and not trees:
            return None  # each tree has an error, which must not cause another one about a file without trees
        return TreeFile(
            file=self._file,
            main=None if main is None else main.value,
            includes=tuple(include for include in includes if include is not None),
            trees=tuple(trees),
            models=tuple(models),
            extras=_other_attributes(root, "BTCPP_format", "main_tree_to_execute"),
            last_comments=(*root.comments, *comments, *root.last_comments),
            place=root.place,
            main_place=root.place if main is None else main.place,
        )

    def _check_format(self, root: Element) -> bool:
        """Return whether the file can be read; convert a file of version 3."""
        version = root.get("BTCPP_format")
        if root.tag != "root" or (version is not None and version.value not in (FORMAT, OLD_FORMAT)):
            self._findings.add(
                "no-tree-file",
                f"this is not a file of BehaviorTree.CPP: <{root.tag}>"
                if root.tag != "root" or version is None
                else f"the format {version.value!r} is not a version of BehaviorTree.CPP",
                root.place if root.tag != "root" or version is None else version.place,
                help=f'a file of trees begins with <root BTCPP_format="{FORMAT}">',
            )
            return False
        if version is None and not is_of_version_3(root):
            message = "no BTCPP_format: the file is read as version 4, as BehaviorTree.CPP reads it"
            help_text = f'write <root BTCPP_format="{FORMAT}">, or "{OLD_FORMAT}" if the tree was written for version 3'
            self._findings.add("tree-format", message, root.place, help=help_text)
        elif version is None or version.value == OLD_FORMAT:
            message = "a file of version 3: it is read as if it were converted to version 4"
            help_text = "write it as version 4: codra trees convert FILE --output FILE"
            place = root.place if version is None else version.place
            self._findings.add("tree-format", message, place, help=help_text)
            convert_from_version_3(root)
        return True

    def _include(self, element: Element) -> Include | None:
        package = element.get("ros_pkg")
        if package is not None:
            self._findings.add(
                "tree-include",
                "packages of ROS are not searched",
                package.place,
                help="copy the file into the project, and include it by its path",
            )
            return None
        path = self._required_attribute(element, "path")
        return None if path is None else Include(path=path.value, place=path.place)

    def _tree(self, element: Element) -> BehaviorTree | None:
        id_and_place = self._id_of_tree(element)
        if len(element.children) != 1:
            self._findings.add(
                "wrong-children",
                f"a tree has one root, but this one has {len(element.children)} nodes",
                element.place,
                help="put them below one node, e.g. <Sequence>",
            )
        roots = [self._node(child) for child in element.children]
        if id_and_place is None or len(roots) != 1 or roots[0] is None:
            return None
        return BehaviorTree(
            id=id_and_place[0],
            root=roots[0],
            extras=_other_attributes(element, "ID"),
            comments=element.comments,
            last_comments=element.last_comments,
            place=id_and_place[1],
        )

    def _id_of_tree(self, element: Element) -> tuple[str, Place] | None:
        """Return the id of a tree and its place. Only the single tree of a file needs none."""
        name = element.get("ID")
        if not self._is_single_tree or (name is not None and name.value):
            name = self._required_attribute(element, "ID")
            return None if name is None else (name.value, name.value_place)
        self._findings.add(
            "tree-without-id",
            f"the tree has no ID: it is read as '{UNNAMED_TREE}'",
            element.place,
            help='write <BehaviorTree ID="...">; Groot2 needs it',
        )
        return UNNAMED_TREE, element.place

    def _node(self, element: Element) -> TreeNode | None:
        """Return a node with all nodes below it, or None if its id is missing."""
        has_explicit_tag = element.tag in _EXPLICIT_TAGS
        kind = NodeKind(element.tag) if has_explicit_tag else None
        id_attribute = self._required_attribute(element, "ID") if has_explicit_tag else None
        children = [self._node(child) for child in element.children]
        if has_explicit_tag and id_attribute is None:
            return None
        is_subtree = kind is NodeKind.SUBTREE
        other_attributes = [
            attribute
            for attribute in element.attributes
            if attribute.name not in (("ID", "name") if has_explicit_tag else ("name",))
        ]
        name = element.get("name")
        return TreeNode(
            id="SubTree" if is_subtree else element.tag if id_attribute is None else id_attribute.value,
            kind=None if is_subtree else kind,
            subtree=id_attribute.value if is_subtree and id_attribute is not None else None,
            name=None if name is None else name.value,
            ports=tuple(
                attribute
                for attribute in other_attributes
                if not attribute.name.startswith("_") or attribute.name == "_autoremap"
            ),
            conditions=tuple(attribute for attribute in other_attributes if attribute.name in _CONDITION_ATTRIBUTES),
            extras=tuple(
                attribute
                for attribute in other_attributes
                if attribute.name.startswith("_")
                and attribute.name not in _CONDITION_ATTRIBUTES
                and attribute.name != "_autoremap"
            ),
            children=tuple(child for child in children if child is not None),
            comments=element.comments,
            last_comments=element.last_comments,
            place=element.place,
        )

    def _models(self, element: Element) -> Iterable[NodeModel]:
        for child in element.children:
            if child.tag not in _EXPLICIT_TAGS:
                self._report_misplaced_element(child, f"<{_MODELS_TAG}>", sorted(_EXPLICIT_TAGS))
                continue
            name = self._required_attribute(child, "ID")
            ports = [
                port
                for port_element in child.children[:MAX_ATTRIBUTES]
                if (port := self._port(port_element)) is not None
            ]
            if len(child.children) > MAX_ATTRIBUTES:
                message = f"over {MAX_ATTRIBUTES} ports: a node cannot have so many attributes"
                self._findings.add("too-many-tree-nodes", message, child.place, help="split it into several nodes")
            if name is not None:
                yield NodeModel(
                    kind=NodeKind(child.tag),
                    id=name.value,
                    ports=tuple(ports),
                    description=next(
                        (inner.text.strip() for inner in child.children if inner.tag == "description"), ""
                    ),
                    metadata=tuple(
                        field.attributes
                        for inner in child.children
                        if inner.tag == _METADATA_TAG
                        for field in inner.children[:MAX_ATTRIBUTES]
                    ),
                    extras=_other_attributes(child, "ID"),
                    place=name.value_place,
                )

    def _port(self, element: Element) -> Port | None:
        if element.tag in (_METADATA_TAG, "description"):
            return None
        if element.tag not in _DIRECTIONS:
            self._report_misplaced_element(element, "the model of a node", list(Direction))
            return None
        name = self._required_attribute(element, "name")
        if name is None:
            return None
        values = {attribute.name: attribute.value for attribute in element.attributes}
        return Port(
            direction=_DIRECTIONS[element.tag],
            name=name.value,
            type=values.get("type"),
            default=values.get("default"),
            description=(element.text.strip() or values.get("description", "")).strip(),
            place=name.value_place,
        )

    def _required_attribute(self, element: Element, name: str) -> Attribute | None:
        attribute = element.get(name)
        if attribute is not None and attribute.value:
            return attribute
        self._findings.add(
            "missing-attribute",
            f"<{element.tag}> has no '{name}'",
            element.place,
            help=f'write <{element.tag} {name}="...">',
        )
        return None

    def _report_misplaced_element(self, element: Element, parent: str, allowed: Iterable[str]) -> None:
        allowed_tags_text = ", ".join(f"<{tag}>" for tag in allowed)
        help_text = self._findings.name_help(element.tag, allowed, f"{parent} may contain {allowed_tags_text}")
        self._findings.add(
            "misplaced-element", f"<{element.tag}> is not allowed in {parent}", element.place, help=help_text
        )


def _all_comments(element: Element) -> Iterable[str]:
    """Yield the comments of an element and of all elements inside it; the element's value has no field for comments."""
    yield from element.comments
    for child in element.children:
        yield from _all_comments(child)
    yield from element.last_comments


def _other_attributes(element: Element, *known_names: str) -> tuple[Attribute, ...]:
    return tuple(attribute for attribute in element.attributes if attribute.name not in known_names)
