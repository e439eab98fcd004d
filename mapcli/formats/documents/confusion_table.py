"""The confusion table of Activity 9.5 as JSON: which pose was found for which.

`mapcli.confusion-table` has `poses`, `counts` (a row for each true pose, a column for each that was
found), `ties` (of each true pose, where nothing could be concluded) and `summary`. Every field:
`schemas/confusion-table.json`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapcli.formats.documents.json_document import document, json_bytes
from mapcli.model.similarity import ConfusionSummary

CONFUSION_TABLE = "mapcli.confusion-table"


def confusion_bytes(
    poses: Sequence[tuple[str, float]],
    counts: NDArray[np.int64],
    summary: ConfusionSummary,
    inputs: Mapping[str, str],
    parameters: Mapping[str, Any],
) -> bytes:
    """A confusion table as a document.

    Args:
        poses: position and turn in degrees; counts: shape (poses, poses + 1), ties last.
    """
    content = {
        "poses": [{"position": position, "turn_deg": turn} for position, turn in poses],
        "counts": counts[:, :-1].tolist(),
        "ties": counts[:, -1].tolist(),
        "summary": asdict(summary),
    }
    return json_bytes(document(CONFUSION_TABLE, inputs, parameters, content))
