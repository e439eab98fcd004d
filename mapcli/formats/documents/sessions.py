"""Maps of several drives (`mapcli.sessions`): what became of each drive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mapcli.formats.documents.json_document import document
from mapcli.model.summary import ReplaySummary

SESSIONS = "mapcli.sessions"


def sessions_document(
    drives: Sequence[Mapping[str, Any]],
    inputs: Mapping[str, str],
    summary: ReplaySummary,
    files: Mapping[str, str],
) -> dict[str, Any]:
    """The document.

    Args:
        drives: a row each, as `sessions.json` of the schemas says.
        summary: of all drives together; files: written with it, path -> SHA-256.
    """
    content = {
        "summary": summary.document(),
        "files": [{"file": Path(name).name, "sha256": digest} for name, digest in files.items()],
        "drives": list(drives),
    }
    return document(SESSIONS, inputs, {}, content)
