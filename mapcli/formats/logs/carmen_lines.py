"""The lines of CARMEN logs: what message is on each, and how many scans one held that was hit."""

from __future__ import annotations

import math
import re

from mapcli.formats.logs.carmen_messages import PARSERS, WORDS

_KNOWN = (
    rb"(ODOM|[FR]LASER|OLDLASER|(ROBOT|RAW)LASER\d|TRUEPOS|PARAM|SYNC|SONAR|NMEA\w+"
    rb"|REMISSION[FR]?LASER\d?|FRAME|LASER_READING|(ODO|SM)_UPDATE|NEFF|RESAMPLE)"
)
_KNOWN_START = re.compile(rb"^%b " % _KNOWN, re.MULTILINE)
_KNOWN_NAME = re.compile(_KNOWN)
_NAME = re.compile(rb"[A-Z][A-Z0-9_]{2,40}")

_USUAL_NAMES = {name.encode(): name for name in PARSERS}
"""Nearly every line starts with one of these, and is spared the pattern."""

_LEAST_WORDS = 10
"""That follow the name of a message of scans."""
_NO_NUMBERS = 3
"""Words of such a message that are none: its name, the host, and one that was hit as well."""


def message_name(line: bytes) -> str | None:
    """The word that a line starts with, if it could be a message's name."""
    words = line[:48].split(None, 1)
    if not words:
        return None
    usual = _USUAL_NAMES.get(words[0])
    if usual is not None:
        return usual
    return words[0].decode() if _NAME.fullmatch(words[0]) else None


def looks_like_carmen(start: bytes) -> bool:
    """Whether a line of the file's beginning starts with a message's name."""
    return _KNOWN_START.search(start.replace(b"\r", b"\n")) is not None


def is_known(name: str) -> bool:
    """Whether it is the name of one of CARMEN's or GMapping's messages."""
    return _KNOWN_NAME.fullmatch(name.encode()) is not None


def scans_in(line: bytes, name: str) -> int:
    """How many scans were on a line that is no valid message of scans.

    They are told by their message's name, which is inside the line where the end of the line before
    was hit; or, where the name was hit, by the shape: as many words and numbers as there should be.

    Args:
        name: of the scans' message.
    """
    inside = 0
    if name.encode() in line:
        parts = line.split(name.encode() + b" ")
        inside = sum(len(part.split(None, _LEAST_WORDS)) > _LEAST_WORDS for part in parts[1:])
    if inside or line.startswith(name.encode()):
        return max(inside, 1)
    words = line.split()
    try:
        shaped = len(words) == WORDS[name](words)
    except (ValueError, IndexError):
        return 0
    return int(shaped and sum(map(_is_number, words)) >= len(words) - _NO_NUMBERS)


def _is_number(word: bytes) -> bool:
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False
