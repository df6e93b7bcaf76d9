"""Repositories of git as files: loose objects, packs, indexes and references, also those that git refuses."""

from __future__ import annotations

import hashlib
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field

_PACK_TYPES = {b"commit": 1, b"tree": 2, b"blob": 3, b"tag": 4}
REF_DELTA = 7
WHO = b"me <me@example.org> 0 +0000"
Entry = tuple[bytes, bytes, bytes]
"""The mode, the name and the object of an entry of a tree."""


@dataclass
class Objects:
    """The objects of a repository.

    Attributes:
        contents: the kind and the content of each object, by its binary name.
    """

    contents: dict[bytes, tuple[bytes, bytes]] = field(default_factory=dict)

    def add(self, kind: bytes, data: bytes) -> bytes:
        """Add an object and return its binary name."""
        name = hashlib.sha1(kind + b" %d\0" % len(data) + data, usedforsecurity=False).digest()
        self.contents[name] = (kind, data)
        return name

    def blob(self, data: bytes) -> bytes:
        """Add a file."""
        return self.add(b"blob", data)

    def tree(self, entries: Sequence[Entry], *, is_sorted: bool = True) -> bytes:
        """Add a folder."""
        if is_sorted:
            entries = sorted(entries, key=lambda entry: entry[1] + b"/" * (entry[0] == b"40000"))
        return self.add(b"tree", b"".join(mode + b" " + name + b"\0" + value for mode, name, value in entries))

    def commit(self, root: bytes, *parents: bytes) -> bytes:
        """Add a commit."""
        lines = [b"tree " + root.hex().encode(), *(b"parent " + parent.hex().encode() for parent in parents)]
        lines += [b"author " + WHO, b"committer " + WHO, b"", b"hostile", b""]
        return self.add(b"commit", b"\n".join(lines))

    def loose_files(self) -> dict[str, bytes]:
        """Return the files of all objects, each by its path in the repository."""
        return {
            loose_path(name): zlib.compress(kind + b" %d\0" % len(data) + data, 1)
            for name, (kind, data) in self.contents.items()
        }

    def pack_files(self, further_records: Sequence[tuple[bytes, bytes]] = ()) -> dict[str, bytes]:
        """Return a pack with all objects, and its index, each by its path in the repository.

        Args:
            further_records: the names and the complete records of further objects, such as deltas.
        """
        records = [(name, pack_record(_PACK_TYPES[kind], data)) for name, (kind, data) in self.contents.items()]
        records += further_records
        return pack_and_index(records)


def loose_path(name: bytes) -> str:
    """Return the path of an object in a repository."""
    return f"objects/{name.hex()[:2]}/{name.hex()[2:]}"


def pack_record(type_number: int, data: bytes, size: int | None = None, base: bytes = b"") -> bytes:
    """Return an object as a pack holds it; a size that is given may be wrong."""
    rest = len(data) if size is None else size
    first, rest = type_number << 4 | rest & 15, rest >> 4
    head = bytearray()
    while rest:
        head.append(first | 0x80)
        first, rest = rest & 0x7F, rest >> 7
    head.append(first)
    return bytes(head) + base + zlib.compress(data, 1)


def pack_and_index(records: Sequence[tuple[bytes, bytes]]) -> dict[str, bytes]:
    """Return the files of a pack with some records."""
    pack = b"PACK" + struct.pack(">II", 2, len(records))
    entries = []
    for name, record in records:
        entries.append((name, zlib.crc32(record), len(pack)))
        pack += record
    pack += hashlib.sha1(pack, usedforsecurity=False).digest()
    entries.sort()
    counts = [sum(entry[0][0] <= byte for entry in entries) for byte in range(256)]
    index = b"\xfftOc" + struct.pack(">I256I", 2, *counts) + b"".join(name for name, _, _ in entries)
    index += b"".join(struct.pack(">I", checksum) for _, checksum, _ in entries)
    index += b"".join(struct.pack(">I", offset) for _, _, offset in entries) + pack[-20:]
    index += hashlib.sha1(index, usedforsecurity=False).digest()
    path = f"objects/pack/pack-{pack[-20:].hex()}"
    return {f"{path}.pack": pack, f"{path}.idx": index}
