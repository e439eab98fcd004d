"""What running a command loads."""

from __future__ import annotations

import subprocess
import sys


def modules_loaded_by(*arguments: str) -> set[str]:
    code = (
        "import sys\nfrom mapcli.cli import main\n"
        f"try: main({list(arguments)!r})\nexcept SystemExit: pass\nprint(*sys.modules)"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return {name.split(".")[0] for name in out.stdout.splitlines()[-1].split()}
