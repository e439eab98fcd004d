"""What all tests share: where things are, and how a command is run.

Builders of inputs that only some tests need are in `support/`.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from mapcli.cli import main

ROOT = Path(__file__).parents[1]
FIXTURES = ROOT / "fixtures"

SHARED = ROOT.parent / "shared"
"""Real logs and maps beside the project; tests that need them skip where they are absent."""


def run(*arguments: object) -> int:
    """Run `mapcli` in this process; its exit code."""
    with pytest.raises(SystemExit) as leaving:
        main([str(argument) for argument in arguments])
    return int(leaving.value.code or 0)


def modules_loaded_by(*arguments: str) -> set[str]:
    """Top-level names of the modules that a command loads in a process of its own."""
    code = (
        "import sys\nfrom mapcli.cli import main\n"
        f"try: main({list(arguments)!r})\nexcept SystemExit: pass\nprint(*sys.modules)"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return {name.split(".")[0] for name in out.stdout.splitlines()[-1].split()}
