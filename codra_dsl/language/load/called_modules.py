"""The definitions in a project's modules, as far as they can be read without importing or running anything.

Only modules in the project's folder, or in its folder `src`, are read. Uncertain cases are never reported: a module
from elsewhere, a module with `__getattr__` or a star import, a function with a decorator.
"""

from __future__ import annotations

import ast
import re
import warnings
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path

from codra_dsl.language.diagnostics import MAX_SUGGESTED_LENGTH, max_slips
from codra_dsl.language.file_queries import folder_names, is_folder, leads_into, read_file, real_path
from codra_dsl.language.frozen import dataclass

MAX_MODULE_BYTES = 512 * 1024
MAX_TOTAL_BYTES = 2 * 1024 * 1024
MAX_MODULES = 200
_MAX_FOLDER_ENTRIES = 2000
_MAX_FILE_NAME = 255
_MAX_FUNCTIONS = 100
_MAX_SUBFOLDERS = 50
_FOLDERS = ("", "src")
_ENTRY = r"__init__\.py"
_MODULE = r".*\.py"
_VISIBLE = r"(?!\.|__pycache__$).*"
_OPAQUE_SUFFIXES = (".so", ".pyd", ".pyc", ".pyx", ".zip")
_SPECIAL_FIELD = re.compile(r"ClassVar|InitVar|KW_ONLY|init=")
_BINDING_FUNCTIONS = frozenset({"globals", "locals", "vars", "exec", "eval", "setattr"})


@dataclass(frozen=True, slots=True)
class Signature:
    """The arguments of a function.

    Attributes:
        accepted_names: the arguments that may be passed by name.
        required_names: the arguments without a default value, including those that cannot be passed by name.
        accepts_any_name: whether the function accepts any other argument (`**rest`).
        is_unfit: whether this is not a function but a class without a method `perceive`.
    """

    accepted_names: frozenset[str]
    required_names: tuple[str, ...]
    accepts_any_name: bool
    is_unfit: bool = False


@dataclass(frozen=True, slots=True)
class Module:
    """The definitions of a module.

    Attributes:
        names: each name that the module defines, with the signature of the function, or of the method `perceive` of the
            class, or None if unknown.
        makers: the functions and classes whose arguments are known, with the arguments of the function or class itself.
        functions: the names with a known signature, up to a maximum number.
        is_open: whether the module may define other names as well.
    """

    names: Mapping[str, Signature | None]
    makers: Mapping[str, Signature]
    functions: tuple[str, ...]
    is_open: bool


OPEN_MODULE = Module({}, {}, (), is_open=True)
"""A module with unknown definitions."""


@dataclass(frozen=True, slots=True)
class MissingModule:
    """The point at which the search for a module fails.

    Attributes:
        part_index: the index, among the parts of the module's name, of the first part that is missing.
        folder: the folder that should contain that part.
    """

    part_index: int
    folder: Path


class ProjectModules:
    """The modules of one project.

    Attributes:
        consulted_files: the files on which the results depend, relative to the root, including files that do not exist.
    """

    def __init__(self, root: Path) -> None:
        self.consulted_files: dict[str, None] = {}
        self._root = real_path(root)
        self._modules: dict[str, Module | MissingModule | None] = {}
        self._folder_entries: dict[tuple[Path, str], frozenset[str] | None] = {}
        self._bytes_left = MAX_TOTAL_BYTES

    def find(self, name: str) -> Module | MissingModule | None:
        """Return the module with a dotted name, or the point at which the search fails; None if neither is certain."""
        if name not in self._modules:
            name_parts = name.split(".")
            if len(self._modules) >= MAX_MODULES or max(map(len, name_parts)) > _MAX_FILE_NAME:
                return None
            self._modules[name] = self._find(name_parts)
        return self._modules[name]

    def module_names(self, folder: Path, misspelt_name: str) -> tuple[str, ...]:
        """Return the names of those packages and modules in a folder that a misspelt name may mean, sorted.

        These are the names of similar length, and the names with which the misspelt name begins. A name that is too
        long for suggestions means none.
        """
        if len(misspelt_name) > MAX_SUGGESTED_LENGTH:
            return ()
        limit = max_slips(misspelt_name)
        lengths = f"{max(1, len(misspelt_name) - limit)},{len(misspelt_name) + limit}"
        beginnings = "|".join(misspelt_name[:end] for end in range(1, len(misspelt_name)))
        pattern = rf"(?:.{{{lengths}}}|{beginnings})(?:\.py)?"
        entry_names = self._list_folder(folder, pattern) or frozenset()
        names = {
            entry.removesuffix(".py") for entry in entry_names if entry.endswith(".py") and not entry.startswith("_")
        }
        names.update(entry for entry in entry_names if entry.isidentifier() and is_folder(folder / entry))
        return tuple(sorted(names))

    def _find(self, name_parts: Sequence[str]) -> Module | MissingModule | None:
        for base in _FOLDERS:
            path = "/".join(filter(None, (base, *name_parts)))
            self.consulted_files[f"{path}.py"] = self.consulted_files[f"{path}/__init__.py"] = None
        bases = (self._root / base for base in _FOLDERS)
        base_folder = next((base for base in bases if self._contains_module(base, name_parts[0])), None)
        return MissingModule(0, self._root) if base_folder is None else self._follow(base_folder, name_parts)

    def _follow(self, folder: Path, name_parts: Sequence[str]) -> Module | MissingModule | None:
        for index, name_part in enumerate(name_parts):
            entry_names = self._list_folder(folder, _module_pattern(name_part))
            if entry_names is None or any(
                name.startswith(f"{name_part}.") and name.endswith(_OPAQUE_SUFFIXES) for name in entry_names
            ):
                return None
            is_last = index == len(name_parts) - 1
            if is_last and f"{name_part}.py" in entry_names and name_part not in entry_names:
                return self._read(folder / f"{name_part}.py")
            if name_part not in entry_names:
                return None if self._may_extend_path(folder, index) else MissingModule(index, folder)
            folder /= name_part
        entry_names = self._list_folder(folder, _ENTRY)
        return self._read(folder / "__init__.py") if entry_names and "__init__.py" in entry_names else None

    def _contains_module(self, folder: Path, name: str) -> bool:
        """Return whether a folder contains a module or a package with this name.

        A package must have Python files in its folder or one level below.
        """
        entry_names = self._list_folder(folder, _module_pattern(name)) or frozenset()
        if f"{name}.py" in entry_names:
            return True
        package = folder / name
        package_entries = sorted((self._list_folder(package, _VISIBLE) or ()) if name in entry_names else ())
        subfolders = (package / entry for entry in package_entries[:_MAX_SUBFOLDERS] if is_folder(package / entry))
        return _has_python(package_entries) or any(
            _has_python(self._list_folder(subfolder, _MODULE) or ()) for subfolder in subfolders
        )

    def _list_folder(self, folder: Path, pattern: str) -> frozenset[str] | None:
        """Return the names in a folder of the project that match a pattern.

        Return None if the folder is missing or has too many entries.
        """
        if (folder, pattern) not in self._folder_entries:
            self._folder_entries[folder, pattern] = self._scan_folder(folder, pattern)
        return self._folder_entries[folder, pattern]

    def _scan_folder(self, folder: Path, pattern: str) -> frozenset[str] | None:
        try:
            if not leads_into(folder, self._root):
                return None
            return folder_names(folder, _MAX_FOLDER_ENTRIES, pattern)
        except (OSError, RuntimeError, ValueError):
            return None

    def _may_extend_path(self, folder: Path, depth: int) -> bool:
        """Return whether a package may change its `__path__`."""
        path = folder / "__init__.py"
        data = self._read_bytes(path) if depth and "__init__.py" in (self._list_folder(folder, _ENTRY) or ()) else b""
        if depth:
            self.consulted_files[path.relative_to(self._root).as_posix()] = None
        return data is None or b"__path__" in data

    def _read(self, path: Path) -> Module:
        data = self._read_bytes(path)
        return OPEN_MODULE if data is None else _parse_module(data)

    def _read_bytes(self, path: Path) -> bytes | None:
        """Return the content of a regular file in the project.

        Return None for any other file, and for a file that is unreadable or too large.
        """
        try:
            data = read_file(path, min(self._bytes_left, MAX_MODULE_BYTES), within=self._root)
        except OSError:
            return None
        self._bytes_left -= len(data)
        return data


def _module_pattern(name: str) -> str:
    """Return the pattern of the files and the folder that can define a module or a package."""
    return rf"{name}(?:\..*)?"


def _has_python(names: Iterable[str]) -> bool:
    return any(name.endswith(".py") for name in names)


@lru_cache(maxsize=256)
def _parse_module(data: bytes) -> Module:
    """Return the definitions in the text of a module, or `OPEN_MODULE` if it is not valid Python of this version."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            tree = ast.parse(data)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return OPEN_MODULE
    names: dict[str, Signature | None] = {}
    for name, signature in _definitions(tree.body, is_top_level=True):
        names[name] = None if name in names else signature
    is_open = "__getattr__" in names or "*" in names or any(map(_may_bind_names, ast.walk(tree)))
    functions = [name for name, signature in names.items() if signature is not None]
    return Module(names, _makers(tree.body, names), tuple(functions[:_MAX_FUNCTIONS]), is_open=is_open)


def _makers(body: Sequence[ast.stmt], names: Mapping[str, Signature | None]) -> Mapping[str, Signature]:
    """Return the functions and classes that are certain, with the arguments with which each is called."""
    counts = Counter(name for name, _ in _definitions(body, is_top_level=True))
    classes = {statement.name: statement for statement in body if isinstance(statement, ast.ClassDef)}
    signatures = {name: _constructor(classes[name]) if name in classes else names[name] for name in names}
    return {name: signature for name, signature in signatures.items() if signature is not None and counts[name] == 1}


def _definitions(body: Sequence[ast.stmt], *, is_top_level: bool) -> Iterator[tuple[str, Signature | None]]:
    """Yield every name that statements bind, with its signature, or None if the signature is not certain.

    A star import yields the name `*`.
    """
    for statement in body:
        if isinstance(statement, (ast.FunctionDef, ast.AsyncFunctionDef)):
            yield (
                statement.name,
                _signature(statement.args, 0) if is_top_level and not statement.decorator_list else None,
            )
        elif isinstance(statement, ast.ClassDef):
            yield statement.name, _signature_of_class(statement) if is_top_level else None
        elif isinstance(statement, (ast.Import, ast.ImportFrom)):
            for alias in statement.names:
                yield alias.asname or alias.name.partition(".")[0], None
        else:
            yield from _definitions(list(_inner_statements(statement)), is_top_level=False)
            name_nodes = (node for node in ast.walk(statement) if isinstance(node, ast.Name))
            yield from ((node.id, None) for node in name_nodes if isinstance(node.ctx, ast.Store))


def _inner_statements(statement: ast.stmt) -> Iterator[ast.stmt]:
    """Yield the statements inside a statement, including the statements in its branches."""
    for part in ast.iter_child_nodes(statement):
        if isinstance(part, ast.stmt):
            yield part
        elif isinstance(part, (ast.ExceptHandler, ast.match_case)):
            yield from part.body


def _may_bind_names(node: ast.AST) -> bool:
    """Return whether a node may bind names that are not in the source."""
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in _BINDING_FUNCTIONS


def _signature_of_class(statement: ast.ClassDef) -> Signature | None:
    """Return the signature of a class's method `perceive`, or None if it is uncertain.

    The class is instantiated without arguments.
    """
    if statement.bases or statement.keywords or statement.decorator_list:
        return None
    definitions = list(_definitions(statement.body, is_top_level=False))
    perceive_definitions = [name for name, _ in definitions if name == "perceive"]
    if not perceive_definitions:
        return Signature(frozenset(), (), accepts_any_name=False, is_unfit=True)
    methods = [method for method in statement.body if isinstance(method, ast.FunctionDef) and method.name == "perceive"]
    if len(perceive_definitions) > 1 or len(methods) != 1 or methods[0].decorator_list:
        return None
    return _signature(methods[0].args, 1)


def _constructor(statement: ast.ClassDef) -> Signature | None:
    """Return the arguments with which a class makes an instance, or None if they are uncertain."""
    names = [name for name, _ in _definitions(statement.body, is_top_level=False)]
    if statement.bases or statement.keywords or "__new__" in names:
        return None
    if statement.decorator_list:
        is_plain = [ast.unparse(decorator) for decorator in statement.decorator_list] == ["dataclass"]
        return _fields(statement) if is_plain and "__init__" not in names else None
    methods = [method for method in statement.body if isinstance(method, ast.FunctionDef) and method.name == "__init__"]
    if len(methods) != names.count("__init__") or len(methods) > 1:
        return None
    if not methods:
        return Signature(frozenset(), (), accepts_any_name=False)
    return None if methods[0].decorator_list else _signature(methods[0].args, 1)


def _fields(statement: ast.ClassDef) -> Signature | None:
    """Return the fields of a dataclass as arguments, or None if one of them may be special."""
    fields = [field for field in statement.body if isinstance(field, ast.AnnAssign)]
    texts = [ast.unparse(field) for field in fields]
    if not all(isinstance(field.target, ast.Name) for field in fields) or any(map(_SPECIAL_FIELD.search, texts)):
        return None
    names = {ast.unparse(field.target): field.value is None for field in fields}
    required_names = tuple(name for name, is_required in names.items() if is_required)
    return Signature(frozenset(names), required_names, accepts_any_name=False)


def _signature(arguments: ast.arguments, implicit_count: int) -> Signature:
    """Return the signature of a function. Python itself passes the first `implicit_count` arguments."""
    positional_parameters = [*arguments.posonlyargs, *arguments.args]
    optional_names = {
        argument.arg for argument in positional_parameters[len(positional_parameters) - len(arguments.defaults) :]
    }
    keyword_defaults = zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True)
    optional_names.update(argument.arg for argument, default in keyword_defaults if default is not None)
    parameters = [*positional_parameters[implicit_count:], *arguments.kwonlyargs]
    positional_only_names = {argument.arg for argument in arguments.posonlyargs}
    return Signature(
        accepted_names=frozenset(argument.arg for argument in parameters if argument.arg not in positional_only_names),
        required_names=tuple(argument.arg for argument in parameters if argument.arg not in optional_names),
        accepts_any_name=arguments.kwarg is not None,
    )
