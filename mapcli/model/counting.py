"""How many there are of something, in words."""

from __future__ import annotations


def counted(times: int, what: str) -> str:
    """ "1 scan without beams", "2,000 scans without beams"."""
    noun, space, rest = what.partition(" ")
    return f"{times:,} {noun.removesuffix('s') if times == 1 else noun}{space}{rest}"
