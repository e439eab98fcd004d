"""What algorithms have to say while they work, beside their results: to nobody, unless listened to.

A command listens and tells it on stderr (`commands/_options.py`); a program that imports mapcli
hears nothing.
"""

from __future__ import annotations

from collections.abc import Callable

Listener = Callable[[str], None]

_listeners: dict[str, Listener] = {}


def listen(*, note: Listener | None, progress: Listener | None) -> None:
    """Take who hears notes, and who hears what passes while a person waits; None is nobody."""
    _listeners.clear()
    _listeners.update({"note": note} if note else {})
    _listeners.update({"progress": progress} if progress else {})


def note(text: str) -> None:
    """Say something that the user may want to change."""
    if "note" in _listeners:
        _listeners["note"](text)


def progress(text: str) -> None:
    """Say what takes so long."""
    if "progress" in _listeners:
        _listeners["progress"](text)
