"""Damage to valid files, by anything that draws like `random.Random`.

Hypothesis hands the tests a `Random` whose draws it shrinks; by hand, a seeded one is fast.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Sequence
from random import Random

NUMBER = re.compile(rb"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")

NUMBERS = (
    b"0", b"-0", b"-1", b"1", b"0.5", b"2", b"255", b"256", b"65535", b"65536", b"2147483648",
    b"4294967295", b"9223372036854775807", b"-9223372036854775809", b"18446744073709551616",
    b"1e6", b"1e7", b"1e8", b"1e9", b"1e-9", b"1e18", b"1e19", b"1e300", b"1e308", b"-1e308",
    b"1e309", b"1e-320", b"1e999999999", b"nan", b"-nan", b".nan", b"NaN", b"inf", b"-.inf",
    b"Infinity", b"1_000", b"0x10", b"1e", b"-", b"9" * 20, b"9" * 400, b"9" * 5000,
    b"0." + b"0" * 400 + b"1", "\u0663".encode(), b"null", b"true", b"[]", b"{}", b'""',
)  # fmt: skip
"""What a number may be replaced with: limits of types, of sizes, of sense; and no numbers."""

WORDS = (
    b"\x00", b"\n", b"\r", b"\t", b" ", b",", b":", b"#", b"-", b"?", b"[", b"]", b"{", b"}", b'"',
    b"'", b"&a ", b"*a", b"!!python/object:os.system ", b"!", b"|", b">", b"%", b"@", b"<<: ",
    b"---\n", b"...\n", b"\xef\xbb\xbf", b"\xff\xfe", b"\x1b]52;c;aGk=\x07", b"\xe2\x80\xa8",
    b"\xc2\x85", b"\xe2\x80\xae", b"\xed\xa0\x80", b"\xf0\x9f\xa4\x96", b"\x80", b"\xff",
    b"/dev/zero", b"..", b"~", b"~nobody/", b"P5\n", b"\x89PNG", b"\x89MCAP0\r\n", b"\x1f\x8b",
)  # fmt: skip
"""What may be put in anywhere: marks of the grammars, of terminals, of encodings, of formats."""

FIELDS = tuple(
    struct.pack(form, value)
    for form, values in {
        "<B": (0, 1, 127, 128, 255),
        "<H": (0x7FFF, 0xFFFF),
        "<I": (0, 1, 0xFFFF, 0x10000, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFE, 0xFFFFFFFF),
        ">I": (1, 0xFFFF, 0x10000, 0x7FFFFFFF),
        "<Q": (0, 0xFFFFFFFF, 0x100000000, 2**63 - 1, 2**63, 2**64 - 1),
        "<f": (1e38, float("nan"), float("inf"), -1.0),
        "<d": (1e308, -1e308, float("nan"), float("inf"), 1e9, 1e-320),
    }.items()
    for value in values
)
"""What a field of a binary format may hold: lengths and numbers at the limits of their types."""


def mutate(data: bytes, random: Random, others: Sequence[bytes] = ()) -> bytes:
    """The bytes after one to a few pieces of damage; `others` are files to be spliced with."""
    operations = _OPERATIONS if others else _OPERATIONS[:-1]
    for _ in range(random.choice((1, 1, 1, 2, 2, 3, 5))):
        operation = random.choice(operations)
        data = _spliced(data, random, others) if operation is None else operation(data, random)
    return data


def swollen(data: bytes, random: Random, size: int) -> bytes:
    """The bytes with a part, a line or a few bytes, repeated until there are `size`."""
    ends = [match.end() for match in re.finditer(rb"\n", data)]
    if len(ends) > 1 and random.random() < 0.5:
        k = random.randrange(len(ends) - 1)
        start, end = ends[k], ends[k + 1]
    else:
        start = random.randrange(max(len(data), 1))
        end = min(start + random.choice((1, 2, 4, 8, 16, 32, 64, 128)), len(data))
    part = data[start:end] or b"\n"
    return data[:end] + part * ((size - len(data)) // len(part)) + data[end:]


def _bit(data: bytes, random: Random) -> bytes:
    if not data:
        return data
    at = random.randrange(len(data))
    return data[:at] + bytes([data[at] ^ (1 << random.randrange(8))]) + data[at + 1 :]


def _part(data: bytes, random: Random, longest: int = 64) -> tuple[int, int]:
    """Start and end of a part, mostly a short one."""
    start = random.randrange(len(data) + 1)
    length = random.randrange(longest) if random.random() < 0.8 else random.randrange(len(data) + 1)
    return start, min(start + length, len(data))


def _inserted(data: bytes, random: Random) -> bytes:
    at = random.randrange(len(data) + 1)
    return data[:at] + random.choice(WORDS) * random.choice((1, 1, 1, 2, 60)) + data[at:]


def _deleted(data: bytes, random: Random) -> bytes:
    start, end = _part(data, random)
    return data[:start] + data[end:]


def _repeated(data: bytes, random: Random) -> bytes:
    start, end = _part(data, random)
    return data[:end] + data[start:end] * random.choice((1, 1, 2, 9)) + data[end:]


def _truncated(data: bytes, random: Random) -> bytes:
    return data[: random.randrange(len(data) + 1)]


def _field(data: bytes, random: Random) -> bytes:
    new = random.choice(FIELDS)
    at = random.randrange(max(len(data) - len(new), 0) + 1)
    return data[:at] + new + data[at + len(new) :]


def _number(data: bytes, random: Random) -> bytes:
    found = list(NUMBER.finditer(data))
    if not found:
        return _field(data, random)
    chosen = random.choice(found)
    return data[: chosen.start()] + random.choice(NUMBERS) + data[chosen.end() :]


def _lines(data: bytes, random: Random) -> bytes:
    """A line twice, two lines swapped, or one taken out."""
    lines = data.splitlines(keepends=True)
    if len(lines) < 2:
        return _repeated(data, random)
    a, b = random.randrange(len(lines)), random.randrange(len(lines))
    change = random.randrange(3)
    if change == 0:
        lines.insert(b, lines[a])
    elif change == 1:
        lines[a], lines[b] = lines[b], lines[a]
    else:
        del lines[a]
    return b"".join(lines)


def _swapped_words(data: bytes, random: Random) -> bytes:
    """A word of the file in the place of another."""
    words = list(re.finditer(rb"[^\s,:\[\]{}]+", data))
    if not words:
        return data
    a, b = random.choice(words), random.choice(words)
    return data[: a.start()] + b.group() + data[a.end() :]


def _spliced(data: bytes, random: Random, others: Sequence[bytes]) -> bytes:
    other = random.choice(others)
    return data[: random.randrange(len(data) + 1)] + other[random.randrange(len(other) + 1) :]


Operation = Callable[[bytes, Random], bytes]

_OPERATIONS: tuple[Operation | None, ...] = (
    _bit, _inserted, _deleted, _repeated, _truncated, _field, _number, _number, _lines,
    _swapped_words, None,
)  # fmt: skip
"""None is `_spliced`, for which another file is needed."""
