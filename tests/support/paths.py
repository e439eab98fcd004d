"""Where the project and its data are."""

from pathlib import Path

ROOT = Path(__file__).parents[2]
FIXTURES = ROOT / "fixtures"

SHARED = ROOT.parent / "shared"
"""Real logs and maps beside the project; tests that need them skip where they are absent."""
