"""What somebody may have meant who typed no command."""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterable

from mapcli.formats.file_kind import kind_at

MEANT = {
    "map": "slam-replay", "mapping": "slam-replay", "localize": "slam-replay",
    "explore": "frontier", "exploration": "frontier", "match": "similarity-table",
    "drive": "simulate", "draw": "render", "plot": "render", "show": "render", "view": "render",
    "diff": "compare", "crop": "transform", "rotate": "transform", "merge": "transform",
    "straighten": "rectify", "help": "--help",
}  # fmt: skip
"""Words that people type -> what they mean, where the letters do not tell."""


def hint_for_command(word: str, commands: Iterable[str]) -> str:
    """A sentence, with a blank before it, or nothing."""
    if os.path.exists(word):
        kind = kind_at(word)
        return f" It is {kind}." if kind else " It is a file; mapcli info says what is in it."
    meant = meant_by(word.lower().replace("_", "-"), list(commands))
    return f" Did you mean {meant!r}?" if meant else ""


def meant_by(word: str, commands: list[str]) -> str | None:
    """A command of which the word is the beginning or a part, means the same, or is misspelt."""
    parts = [name for name in commands if len(word) > 2 and (word in name or name in word)]
    close = difflib.get_close_matches(word, [*commands, *MEANT], n=1)
    for found in (word, *parts, *close):
        if found in commands:
            return found
        if found in MEANT:
            return MEANT[found]
    return None
