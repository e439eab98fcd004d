"""PGM, PNG and MCAP files made from their grammars, with odd fields here and there."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from random import Random

import lz4.frame
import zstandard
from fuzz.mutations import FIELDS, mutate
from fuzz.text_grammars import ODD, image_yaml, mapping, number

NOTE = b"mapcli map"


def odd(random: Random) -> bool:
    return random.random() < ODD


# --- PGM and PNG


def pgm(random: Random) -> bytes:
    magic = random.choice((b"P2", b"P5", b"P5"))
    rows, columns = random.randrange(1, 6), random.randrange(1, 6)
    maxval = random.choice((255, 255, 100, 65535, 256, 1, 0, 65536))
    size = [number(random) if odd(random) else b"%d" % n for n in (columns, rows, maxval)]
    between = [random.choice((b" ", b"\n", b"\r\n", b"\n# c\n", b"#")) for _ in range(3)]
    head = magic + b"\n" + (note(random) if random.random() < 0.3 else b"")
    head += b"".join(part + blank for part, blank in zip(size, between, strict=True))
    count = rows * columns + (random.choice((-1, 1, 40)) if odd(random) else 0)
    if magic == b"P2":
        return head + b" ".join(number(random, ("0", "254", "255", "1")) for _ in range(count))
    return head + random.randbytes(max(count, 0) * (2 if maxval > 255 else 1))


def note(random: Random) -> bytes:
    """mapcli's metadata in comments."""
    body = image_yaml(random) if odd(random) else mapping(random, ("resolution", "origin", "mode"))
    return b"# mapcli map\n" + b"".join(b"# " + line + b"\n" for line in body.splitlines())


def png(random: Random) -> bytes:
    """Checksums are right, so that the content is looked at."""
    depth, colour = random.choice(
        ((8, 0), (8, 0), (1, 0), (16, 0), (8, 2), (8, 3), (4, 3), (8, 4), (8, 6), (16, 6), (3, 5))
    )
    rows, columns = random.randrange(1, 6), random.randrange(1, 6)
    size = [random.choice((0, 1, 60_000, 2**31 - 1, 2**32 - 1)) if odd(random) else n
            for n in (columns, rows)]  # fmt: skip
    method = [1 if odd(random) else 0 for _ in range(3)]
    chunks = [(b"IHDR", struct.pack(">IIBBBBB", *size, depth, colour, *method))]
    if colour == 3 and not odd(random):
        chunks.append((b"PLTE", random.randbytes(random.choice((3, 6, 768, 2)))))
    if random.random() < 0.3:
        chunks.append((b"tRNS", random.randbytes(random.choice((0, 1, 2, 6, 300)))))
    if random.random() < 0.5:
        text = NOTE + b"\0" + mapping(random, ("resolution", "origin", "mode"))
        name = random.choice((b"tEXt", b"zTXt", b"iTXt"))
        chunks.append((name, text if name == b"tEXt" else mutate(text, random)))
    width = (columns * depth * {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}.get(colour, 1) + 7) // 8
    lines = b"".join(
        bytes([random.choice((0, 0, 1, 2, 3, 4, 9))]) + random.randbytes(width) for _ in range(rows)
    )
    pixels = zlib.compress(lines)
    chunks.append((b"IDAT", mutate(pixels, random) if odd(random) else pixels))
    chunks.append((b"IEND", b""))
    if odd(random):
        chunks.insert(random.randrange(len(chunks) + 1), random.choice(chunks))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_png_chunk(*chunk) for chunk in chunks)


def _png_chunk(kind: bytes, content: bytes) -> bytes:
    checksum = zlib.crc32(content, zlib.crc32(kind))
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", checksum)


# --- MCAP

MAGIC = b"\x89MCAP0\r\n"

Channel = tuple[str, str, str, Sequence[bytes]]
"""Topic, type, encoding, and contents of messages."""


def mcap(random: Random, channels: Sequence[Channel]) -> bytes:
    """A log whose records are framed as they should be, mostly; what is in them is damaged here
    and there. No checksum is set, so that contents are looked at."""
    chosen = [channel for channel in channels if random.random() > 2 * ODD]
    head = [_record(random, 1, _string(random, b"ros2") + _string(random, b"fuzz"))]
    told = [_description(random, k, channel) for k, channel in enumerate(chosen, start=1)]
    messages = [
        _message(random, k, stamp, data)
        for k, channel in enumerate(chosen, start=1)
        for stamp, data in enumerate(channel[3], start=1)
    ]
    random.shuffle(messages)
    if random.random() < 0.2:
        body = told + messages
    else:
        middle = random.randrange(len(messages) + 1)
        body = [
            _chunk(random, b"".join(told + messages[:middle])),
            _chunk(random, b"".join(messages[middle:])),
        ]
    body.append(_record(random, 15, struct.pack("<I", 0)))
    start = len(MAGIC) + sum(map(len, head + body))
    summary = [*told, _statistics(random, len(messages), len(chosen))]
    footer = struct.pack("<QQI", start if random.random() < 0.7 else 0, 0, 0)
    data = MAGIC + b"".join([*head, *body, *summary, _record(random, 2, footer)]) + MAGIC
    return mutate(data, random) if odd(random) else data


def _record(random: Random, opcode: int, content: bytes) -> bytes:
    if odd(random):
        content = mutate(content, random, [content])
    length = _or_field(random, struct.pack("<Q", len(content)), 0.01)
    return bytes([opcode]) + length + content


def _or_field(random: Random, right: bytes, chance: float = ODD / 2) -> bytes:
    """A field, or something else of its length."""
    if random.random() > chance:
        return right
    return random.choice([field for field in FIELDS if len(field) == len(right)])


def _string(random: Random, text: bytes) -> bytes:
    return _or_field(random, struct.pack("<I", len(text)), 0.01) + text


def _description(random: Random, number: int, channel: Channel) -> bytes:
    topic, kind, encoding, _ = channel
    name = _string(random, kind.encode())
    schema = struct.pack("<H", number) + name + _string(random, b"ros2msg") + _string(random, b"x")
    ids = _or_field(random, struct.pack("<H", number)) + _or_field(
        random, struct.pack("<H", number)
    )
    names = _string(random, topic.encode()) + _string(random, encoding.encode())
    told = ids + names + struct.pack("<I", 0)
    return _record(random, 3, schema) + _record(random, 4, told)


def _message(random: Random, channel: int, stamp: int, data: bytes) -> bytes:
    time = _or_field(random, struct.pack("<Q", stamp * 10**9), 0.02)
    if random.random() < 0.15:
        data = mutate(data, random, [data])
    return _record(random, 5, struct.pack("<HI", channel, 0) + time + time + data)


def _chunk(random: Random, records: bytes) -> bytes:
    compression = random.choice((b"", b"zstd", b"lz4"))
    data = records
    if compression == b"zstd":
        data = zstandard.compress(records, 1)
    elif compression == b"lz4":
        data = lz4.frame.compress(records)
    if odd(random):
        data = mutate(data, random)
    if odd(random):
        compression = random.choice((b"", b"zstd", b"lz4", b"zst", b"\xff", b"zstd\0"))
    size = _or_field(random, struct.pack("<Q", len(records)), ODD)
    checksum = struct.pack("<I", zlib.crc32(records) if random.random() < 0.3 else 0)
    head = struct.pack("<QQ", 0, 10**10) + size + checksum + _string(random, compression)
    return _record(random, 6, head + struct.pack("<Q", len(data)) + data)


def _statistics(random: Random, messages: int, channels: int) -> bytes:
    counts = struct.pack("<QHIIIIQQ", messages, channels, channels, 0, 0, 2, 0, 10**10)
    return _record(random, 11, _or_field(random, counts[:8]) + counts[8:] + struct.pack("<I", 0))
