"""Hostile journals: journals of real runs, with damage to their records, chunks, messages, summaries and sizes."""

from __future__ import annotations

import json
import re
import struct
import tempfile
import zlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import lz4.frame  # type: ignore[import-untyped]
import zstandard

from codra_dsl.compiler import compile_paths
from codra_dsl.runtime.journal.file_creation import MAGIC
from tests.campaigns.hostile.damage import damaged, damaged_bytes, damaged_json
from tests.campaigns.hostile.reading import OUT, Answer, Files, Kind, command
from tests.campaigns.hostile.texts import NUMBERS, ODD_NAMES, TEXTS
from tests.runtime.journal.journals import run_door

ROOT = Path(__file__).parents[3]
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
ATTACHMENT, METADATA, DATA_END, REGION = 0x09, 0x0C, 0x0F, 0x80
_RECORD = struct.Struct("<BQ")
_LENGTHS = (0, 1, 2**31, 2**32, 2**40, 2**63, 2**64 - 1)
_COMPRESSIONS: dict[bytes, Callable[[bytes], bytes]] = {
    b"": bytes,
    b"zstd": zstandard.ZstdCompressor(level=3).compress,
    b"lz4": lz4.frame.compress,
}
_PACKAGE_FILES = ("pyproject.toml", "specs/", "generated/")
Records = list[tuple[int, bytes]]
"""Pairs of the opcode and the content of a record."""


@cache
def _journals() -> tuple[tuple[Records, ...], tuple[str, ...]]:
    """Return the records of journals, without those of chunks, and names that occur in them."""
    with tempfile.TemporaryDirectory() as folder:
        files = [run_door(Path(folder, f"{loops}.mcap"), loops=loops).path.read_bytes() for loops in (1, 2)]
    files.append((ROOT / "tests/data/earlier_version.mcap").read_bytes())
    return tuple(split(data[len(MAGIC) : -len(MAGIC)]) for data in files), ("near", "door_open", "localized", "look")


def split(data: bytes) -> Records:
    """Return the records in well-formed data."""
    records, place = [], 0
    while place < len(data):
        opcode, length = _RECORD.unpack_from(data, place)
        place += _RECORD.size + length
        records.append((opcode, data[place - length : place]))
    return records


def joined(records: Records) -> bytes:
    """Return the data of records."""
    return b"".join(_RECORD.pack(opcode, len(content)) + content for opcode, content in records)


def _records_of_chunk(content: bytes) -> Records:
    name_length = struct.unpack_from("<I", content, 28)[0]
    data = content[32 + name_length + 8 :]
    return split(zstandard.ZstdDecompressor().decompress(data) if name_length else data)


def _chunk(chance: Random, records: bytes) -> bytes:
    """Return the content of a chunk; sometimes with a wrong size, checksum, compression or time."""
    name, compress = chance.choice(list(_COMPRESSIONS.items()))
    data, size, checksum = compress(records), len(records), chance.choice((0, zlib.crc32(records)))
    length, wrong = len(data), chance.random()
    if wrong < 0.1:
        size = chance.choice((*_LENGTHS, size + 1, max(size - 1, 0)))
    elif wrong < 0.15:
        checksum ^= 1
    elif wrong < 0.2:
        name = chance.choice((b"gzip", b"zstd", b"lz4", b"", b"\xff\xfe", b"x" * 3000))
    elif wrong < 0.25:
        length = chance.choice(_LENGTHS)
    elif wrong < 0.3:
        data = damaged_bytes(chance, data)
    start = struct.pack("<QQQI", chance.choice((0, 2**64 - 1)), 0, size, checksum)
    return start + struct.pack("<I", len(name)) + name + struct.pack("<Q", length) + data


@cache
def _bombs() -> tuple[bytes, ...]:
    """Return contents of chunks that grow to more than they seem, or that have very many records."""
    message = struct.pack("<HIQQ", 1, 1, 0, 0)
    contents = (
        _RECORD.pack(MESSAGE, 30_000_000) + message + bytes(30_000_000 - len(message)),
        joined([(MESSAGE, message)]) * 20_000,
        joined([(MESSAGE, message + b'{"instant_s":1.0,"name":"near","what":"x","q":[' + b"[]," * 500_000 + b"0]}")]),
        joined([(MESSAGE, message + b'{"instant_s":' + b"[" * 100_000)]),
        joined([(SCHEMA, struct.pack("<H", n % 65536) + bytes(12)) for n in range(20_000)]),
        bytes(16_000_000),
    )
    return tuple(
        struct.pack("<QQQI", 0, 0, size, 0) + struct.pack("<I", len(name)) + name + struct.pack("<Q", len(data)) + data
        for records in contents
        for name in (b"zstd", b"lz4")
        for data in (_COMPRESSIONS[name](records),)
        for size in (len(records), 100, 2**63)
    )


def _with_other_messages(chance: Random, content: bytes) -> bytes:
    """Return the content of a chunk with damaged messages, channels and schemas."""
    records = _records_of_chunk(content)
    for _ in range(chance.choice((1, 1, 3, 10))):
        index = chance.randrange(len(records))
        opcode, data = records[index]
        kind = chance.random()
        if kind < 0.55 and opcode == MESSAGE:
            records[index] = (opcode, data[:22] + _damaged_object(chance, data[22:]))
        elif kind < 0.65:
            records[index] = (opcode, damaged_bytes(chance, data))
        elif kind < 0.75:
            del records[index : index + chance.choice((1, 3))]
            records = records or [(opcode, data)]
        elif kind < 0.85:
            records.insert(chance.randrange(len(records)), records[index])
        elif kind < 0.93 and opcode == MESSAGE:
            numbers = (
                chance.choice((0, 1, 2, 65535)),
                chance.choice((0, 1, 2**32 - 1)),
                *chance.choices(_LENGTHS[:3] + _LENGTHS[5:], k=2),
            )
            records[index] = (opcode, struct.pack("<HIQQ", *numbers) + data[22:])
        else:
            records[index] = (chance.choice((*range(16), REGION, 0xFF)), data)
    return _chunk(chance, joined(records))


def _damaged_object(chance: Random, data: bytes) -> bytes:
    """Return a JSON object with damage to its values or its text."""
    try:
        document: Any = json.loads(data)
    except ValueError:
        return damaged_bytes(chance, data)
    if chance.random() < 0.5 and isinstance(document, dict):
        key = chance.choice(("instant_s", "name", "what", "value", "kind", "status", "because", *document))
        document[key] = chance.choice((*TEXTS, *ODD_NAMES[:-30], 1e308, float("nan"), -1, 10**400, None, [], {}, True))
        return json.dumps(document).encode("utf-8", "surrogatepass")
    text = damaged_json(chance, document) if chance.random() < 0.6 else damaged(chance, json.dumps(document), (1, 2))
    return text.encode("utf-8", "surrogatepass")


def _with_other_header(chance: Random, content: bytes, opcode: int) -> bytes:
    """Return metadata or an attachment with damaged content and a fitting checksum."""
    if opcode == METADATA:
        old = chance.choice((b"0.1.0", b"door", b"format_version", b"1", b"seed", b"start_s"))
        text = chance.choice((*NUMBERS, *TEXTS, *ODD_NAMES[:40])).encode("utf-8", "surrogatepass")[: len(old)]
        return content.replace(old, text.ljust(len(old)), 1)
    start = content.find(b"{")
    if start < 0 or chance.random() < 0.1:
        return damaged_bytes(chance, content)
    data = _damaged_object(chance, content[start:-4])
    head = content[: start - 8] + struct.pack("<Q", len(data)) + data
    return head + struct.pack("<I", chance.choice((0, zlib.crc32(head))))


def _make(chance: Random) -> Files:
    journal = chance.choice(_journals()[0])
    records = list(journal)
    for _ in range(chance.choice((1, 1, 2, 3))):
        _damage_record(chance, records, journal)
    data = MAGIC + joined(records) + MAGIC
    kind = chance.random()
    if kind < 0.12:
        data = _with_wrong_length(chance, data)
    elif kind < 0.24:
        data = data[: chance.randrange(len(data) + 1)]
    elif kind < 0.32:
        data = damaged_bytes(chance, data)
    elif kind < 0.34:
        data = chance.choice((b"", MAGIC, MAGIC * 2, bytes(len(data)), data * 2, data[8:], b"\x89MCAP1\r\n" + data))
    arguments = _arguments(chance)
    package = _package() if "replay" in arguments else {}
    return {"run.mcap": data, "command": " ".join(arguments).encode(), **package}


@cache
def _package() -> Files:
    """Return the project of the README, with its compiled package."""
    blocks = re.findall(r"^```\w+ file=(\S+)\n(.*?)^```", (ROOT / "README.md").read_text("utf-8"), re.M | re.S)
    files = {"pyproject.toml": "[tool.codra]\n", **dict(blocks)}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name).resolve()
        for file, text in files.items():
            (folder / file).parent.mkdir(exist_ok=True)
            (folder / file).write_text(text, "utf-8")
        compilation = compile_paths([folder / "specs/door.yaml"], folder)
    generated = {f"generated/{file}": text for file, text in compilation.files.items()}
    return {file: text.encode() for file, text in {**files, **generated}.items() if file.startswith(_PACKAGE_FILES)}


def _damage_record(chance: Random, records: Records, journal: Records) -> None:
    index = chance.randrange(len(records))
    chunks = [number for number, record in enumerate(records) if record[0] == CHUNK and record in journal]
    kind = chance.random()
    if chunks and kind < 0.45:
        index = chance.choice(chunks)
        records[index] = (CHUNK, _with_other_messages(chance, records[index][1]))
    elif kind < 0.49:
        records[index:index] = [(CHUNK, chance.choice(_bombs()))] * chance.choice((1, 1, 20))
    elif kind < 0.65:
        heads = [number for number, (opcode, _) in enumerate(records) if opcode in (METADATA, ATTACHMENT)]
        index = chance.choice(heads or [index])
        opcode, content = records[index]
        records[index] = (opcode, _with_other_header(chance, content, opcode))
    elif kind < 0.75:
        del records[index]
        records[:] = records or [(FOOTER, bytes(20))]
    elif kind < 0.85:
        records.insert(chance.randrange(len(records)), records[index])
    elif kind < 0.95:
        opcode, content = records[index]
        records[index] = (opcode, damaged_bytes(chance, content))
    else:
        records[index] = (chance.choice((*range(17), REGION, 0x81, 0xFF)), records[index][1])


def _with_wrong_length(chance: Random, data: bytes) -> bytes:
    """Return a file in which the length of one record is wrong."""
    places, place = [], len(MAGIC)
    while place + _RECORD.size < len(data) - len(MAGIC):
        places.append(place)
        place += _RECORD.size + _RECORD.unpack_from(data, place)[1]
    place = chance.choice(places)
    opcode, length = _RECORD.unpack_from(data, place)
    wrong_length = chance.choice((*_LENGTHS, length + 1, max(length - 1, 0)))
    return data[:place] + _RECORD.pack(opcode, wrong_length) + data[place + _RECORD.size :]


def _arguments(chance: Random) -> tuple[str, ...]:
    name = chance.choice(_journals()[1])
    return chance.choice(
        (
            ("journal", "show", "run.mcap"),
            ("journal", "recover", "run.mcap", "--output", f"{OUT}/recovered.mcap"),
            ("why", name, "--journal", "run.mcap"),
            ("why", name, "--journal", "run.mcap", "--at", chance.choice(("2", "+1", "0", "1e3")), "--format", "json"),
            ("replay", "run.mcap", *chance.choice(((), ("--format", "json"), ("--spec", "specs/door.yaml")))),
        )
    )


def _read(root: Path) -> Answer:
    """Run a command that reads a journal; read the journal that `recover` writes."""
    arguments = (root / "command").read_text().split()
    answer = command(*arguments)
    if "recover" in arguments and answer.is_accepted:
        again = command("journal", "show", f"{OUT}/recovered.mcap")
        assert again.is_accepted or again.codes, "the recovered journal cannot be read"
    return answer


def _prepare() -> None:
    _journals()
    _bombs()
    _package()


JOURNALS = Kind(_make, _read, prepare=_prepare)
