"""Hostile repositories of git: trees with links, submodules and odd paths; objects, packs and settings with damage."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from random import Random

from tests.campaigns.hostile.damage import damaged, damaged_bytes
from tests.campaigns.hostile.git_objects import REF_DELTA, Entry, Objects, loose_path, pack_record
from tests.campaigns.hostile.reading import Answer, Files, Kind, Link, command
from tests.campaigns.mutants.mutation import projects

FILE, EXECUTABLE, FOLDER, LINK, SUBMODULE = b"100644", b"100755", b"40000", b"120000", b"160000"
_MODES = (
    FILE,
    EXECUTABLE,
    FOLDER,
    LINK,
    SUBMODULE,
    b"100664",
    b"040000",
    b"0",
    b"",
    b"777777",
    b"100644x",
    b"-1",
    b"9" * 30,
)
_NAMES = (
    *(
        b"a.yaml",
        b"b.yml",
        b"parts.txt",
        b"pyproject.toml",
        b"specs",
        b".git",
        b".GIT",
        b"git~1",
        b"..",
        b".",
        b"",
        b"/",
    ),
    *(
        b"../../owned.yaml",
        b"/tmp/owned.yaml",
        b"a/b.yaml",
        b"a\\b.yaml",
        b"-.yaml",
        b"--help.yaml",
        b"a\nb.yaml",
        b"\xff.yaml",
    ),
    *(
        b"a" * 300 + b".yaml",
        b"a" * 5000 + b".yaml",
        b"\xe2\x80\xae.yaml",
        b"\x1b[2J.yaml",
        b"con.yaml",
        b" .yaml",
        b"\x7f.yaml",
    ),
    *(
        b".gitattributes",
        b".gitmodules",
        b".git/hooks",
        b"A.YAML",
        b"a.yaml.",
        b"x.timeline.yaml",
        b".gitignore",
        b"*.yaml",
    ),
)
_CONFIG = "[core]\n\trepositoryformatversion = 0\n\tbare = false\n"
_CONFIGS = (
    *(
        "[core]\n\tfsmonitor = touch owned\n",
        "[core]\n\thooksPath = hooks\n",
        "[core]\n\tworktree = /\n",
        "[core]\n\tbare = true\n",
    ),
    *("[core]\n\trepositoryformatversion = 99\n", "[extensions]\n\tobjectformat = sha256\n", "[extensions]\n\tx = y\n"),
    *(
        '[filter "x"]\n\tclean = touch owned\n\tsmudge = touch owned\n\trequired = true\n',
        "[include]\n\tpath = /dev/zero\n",
    ),
    *(
        '[diff "x"]\n\ttextconv = touch owned\n',
        "[core]\n\tpager = touch owned\n",
        "[alias]\n\tls-tree = !touch owned\n",
    ),
    *(
        "[core]\n\tsshCommand = touch owned\n",
        '[remote "o"]\n\turl = ext::touch owned\n\tpromisor = true\n',
        "[" * 5000,
    ),
    *("[core]\n\tpackedGitLimit = 99999999999999999999\n", "[core]\n\tbigFileThreshold = 1\n", "x = " + "y" * 100_000),
    *("[core]\n\tcompression = x\n", "[extensions]\n\tpartialClone = o\n", "[include]\n\tpath = config\n", "\x00\xff"),
)


@cache
def _specs() -> tuple[str, ...]:
    """Return the small valid specs of this repository that include no parts."""
    return tuple(
        next(iter(files.values()))
        for files in projects().values()
        if len(files) == 1 and len(next(iter(files.values()))) < 2500
    )


class _Maker:
    """Makes one repository; `wild` is the probability with which an entry of a tree is hostile."""

    def __init__(self, chance: Random) -> None:
        self.chance = chance
        self.wild = chance.choice((0.0, 0.02, 0.2))
        self.objects = Objects()

    def root(self) -> bytes:
        """Return the root of a revision: settings, and a few specs."""
        chance, objects = self.chance, self.objects
        specs = [(FILE, f"s{number}.yaml".encode(), self.spec()) for number in range(chance.choice((1, 1, 2, 3)))]
        entries = [(FILE, b"pyproject.toml", objects.blob(b"[tool.codra]\n")), (FOLDER, b"specs", self.tree(specs, 2))]
        return self.tree(entries, 1)

    def spec(self) -> bytes:
        text = self.chance.choice(_specs())
        if self.chance.random() < 0.4:
            text = damaged(self.chance, text, (1, 2))
        if self.chance.random() < self.wild:
            text += f"include: [{self.chance.choice(('parts.txt', '../x.yaml', '/etc/passwd', 's0.yaml', 'link'))}]\n"
        return self.objects.blob(text.encode("utf-8", "surrogatepass"))

    def tree(self, entries: list[Entry], depth: int) -> bytes:
        """Add a tree with some entries, and perhaps with hostile ones."""
        for _ in range(self.chance.choice((0, 1, 3)) if self.chance.random() < 3 * self.wild else 0):
            entries = [*entries, self.hostile_entry(depth)]
        tree = self.objects.tree(entries, is_sorted=self.chance.random() > self.wild / 2)
        if self.chance.random() < self.wild / 4:
            tree = self.objects.add(b"tree", damaged_bytes(self.chance, self.objects.contents[tree][1]))
        return tree

    def hostile_entry(self, depth: int) -> Entry:
        chance, objects = self.chance, self.objects
        name, kind = chance.choice(_NAMES), chance.randrange(7)
        if kind == 0:
            target = chance.choice((b"/etc/passwd", b"..", b"s0.yaml", b"a.yaml", b"/dev/zero", b"x" * 5000, b""))
            return LINK, name, objects.blob(target)
        if kind == 1:
            return SUBMODULE, name, chance.randbytes(20)
        if kind == 2:
            return chance.choice(_MODES), name, self.spec()
        if kind == 3:
            return chance.choice((FILE, FOLDER)), name, chance.choice((chance.randbytes(20), bytes(20), b"short"))
        if kind == 4 and depth < 4:
            return FOLDER, name, self.tree([(FILE, chance.choice(_NAMES), self.spec())], depth + 1)
        if kind == 5:
            return FOLDER, name, self.deep_tree()
        content = chance.choice(
            (b"codra: 1\nname: x\n" + b"#" * 3_000_000, bytes(1000), b"\xff\xfe", b"[" * 100_000, b"")
        )
        return FILE, name, objects.blob(content)

    def deep_tree(self) -> bytes:
        """Return a chain of folders, or folders that hold the next one under many names."""
        depth, width = self.chance.choice(((50, 1), (150, 1), (3, 30), (6, 5)))
        leaf = self.objects.tree([(FILE, b"deep.yaml", self.spec())])
        for _ in range(depth):
            leaf = self.objects.tree([(FOLDER, b"d%d" % number, leaf) for number in range(width)])
        return leaf

    def git_files(self) -> dict[str, bytes | Link]:
        """Return the files of the repository, with damage to some of them."""
        chance, objects = self.chance, self.objects
        first = objects.commit(self.root())
        last = objects.commit(self.root(), first)
        if chance.random() < self.wild:
            kind, data = objects.contents[last]
            last = objects.add(
                chance.choice((kind, b"tag", b"tree", b"blob")),
                damaged(chance, data.decode(), (1, 2)).encode("utf-8", "replace"),
            )
        files: dict[str, bytes | Link] = {}
        is_packed = chance.random() < 0.4
        files |= objects.pack_files(self.deltas()) if is_packed else objects.loose_files()
        files |= {
            "HEAD": b"ref: refs/heads/main\n",
            "config": _CONFIG.encode(),
            "refs/heads/main": last.hex().encode() + b"\n",
            "refs/heads/old": first.hex().encode() + b"\n",
        }
        if chance.random() < 0.5:
            self.damage(files)
        return files

    def deltas(self) -> list[tuple[bytes, bytes]]:
        """Return records of deltas in circles, with missing bases, or that grow to more than they say."""
        if self.chance.random() > self.wild:
            return []
        name, other = self.chance.choice(list(self.objects.contents)), self.chance.randbytes(20)
        copies = b"\x90\x64" * 3000  # each copies the first 100 bytes of the base
        delta = self.chance.choice((b"\x05\x05\x90\x05", b"\x64" + b"\xff" * 9 + copies, b"", b"\x05\x05\x00"))
        return [(other, pack_record(REF_DELTA, delta, base=name)), (name, pack_record(REF_DELTA, delta, base=other))]

    def damage(self, files: dict[str, bytes | Link]) -> None:
        """Damage an object, a pack, a reference or the settings."""
        chance = self.chance
        objects = sorted(path for path in files if path.startswith("objects/"))
        path, kind = chance.choice(objects), chance.randrange(7)
        content = files[path]
        assert isinstance(content, bytes)
        if kind == 0:
            files[path] = damaged_bytes(chance, content)
        elif kind == 1:
            del files[path]
        elif kind == 2:
            wrong = Objects()
            data = chance.choice(
                (b"", b"tree -1\0", b"blob 99999999999999999999\0x", b"blob 5\0too long", b"x" * 10_000)
            )
            name = wrong.add(b"blob", data)
            files[path] = chance.choice((data, wrong.loose_files()[loose_path(name)], files[chance.choice(objects)]))
        elif kind == 3:
            files["config"] = (_CONFIG + chance.choice(_CONFIGS)).encode("utf-8", "replace")
        elif kind == 4:
            path = chance.choice(
                ("HEAD", "refs/heads/main", "packed-refs", "shallow", "index", "info/grafts", "commondir")
            )
            files[path] = chance.choice(
                (b"", b"ref: ../../x\n", b"0" * 40, b"ref: HEAD\n", b"x" * 10_000, bytes(100), b"/\n")
            )
        elif kind == 5:
            path = chance.choice(
                ("objects/info/alternates", "objects/info/commit-graph", "objects/pack/multi-pack-index")
            )
            files[path] = chance.choice(
                (b"/\n", b"../objects\n", b"\xff" * 100, b"CGPH\x01\x01" + b"\xff" * 60, b"x" * 9999)
            )
        else:
            files[chance.choice(("HEAD", "refs/heads/main", "objects/info", path))] = Link(
                chance.choice((".", "..", "HEAD", "/nowhere"))
            )


def _make(chance: Random) -> Files:
    folder = "" if chance.random() < 0.03 else ".git/"
    files: dict[str, bytes | Link] = {
        f"{folder}{path}": content for path, content in _Maker(chance).git_files().items()
    }
    files |= {".git/hooks/post-checkout": b"#!/bin/sh\ntouch owned\n"} if chance.random() < 0.1 else {}
    files |= {"pyproject.toml": b"[tool.codra]\n", "specs/s0.yaml": chance.choice(_specs()).encode()}
    for path, content in list(files.items()):  # a link cannot be the folder of a file
        if isinstance(content, Link):
            files = {other: data for other, data in files.items() if not other.startswith(f"{path}/")}
            files[path] = content
    return {**files, "command": "\n".join(_arguments(chance)).encode()}


def _arguments(chance: Random) -> tuple[str, ...]:
    revision = chance.choice(("main", "old", "HEAD", "HEAD~1", "main^{tree}", "main~9", "@", "v1", "refs/heads/old"))
    paths = chance.choice(((), (), ("specs",), ("specs/s0.yaml",), ("..",)))
    style = chance.choice(((), ("--format", "json"), ("--format", "markdown"), ("--fail-on", "never")))
    if chance.random() < 0.5:
        return ("diff", revision, "specs", *style)
    return ("diff", revision, chance.choice(("main", "old")), *paths, *style)


def _read(root: Path) -> Answer:
    return command(*(root / "command").read_text().split("\n"))


REPOSITORIES = Kind(_make, _read, prepare=_specs)
