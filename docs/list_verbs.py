"""Writes the tables of `docs/python.md` again from the docstrings of the verbs.

python docs/list_verbs.py
"""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import mapcli

PAGE = Path(__file__).with_name("python.md")
INIT = Path(mapcli.__file__)
BEGIN, END = "<!-- names: docs/list_verbs.py writes this -->", "<!-- end of names -->"


def groups() -> dict[str, list[str]]:
    """Heading -> names, as the comments in `mapcli/__init__.py` group them."""
    found: dict[str, list[str]] = {}
    table = INIT.read_text().split("HOMES = {")[1].split("\n}")[0]
    for line in table.strip().splitlines():
        comment, name = re.match(r"\s*# (.*)", line), re.match(r'\s*"(\w+)"', line)
        if comment:
            names = found[comment[1]] = []
        elif name:
            names.append(name[1])
    return found


def first_sentence(name: str) -> str:
    """What a name is for, in one line."""
    text = inspect.getdoc(getattr(mapcli, name)) or ""
    paragraph = " ".join(text.split("\n\n")[0].split())
    return re.split(r"(?<=[a-z)`])[.:](?: |$)", paragraph)[0].replace("|", "\\|")


def tables() -> str:
    lines = []
    for heading, names in groups().items():
        lines += [f"### {heading}", "", "| name | what it does |", "|---|---|"]
        lines += [f"| `{name}` | {first_sentence(name)} |" for name in names]
        lines.append("")
    return "\n".join(lines)


def page() -> str:
    """The page with its tables as they should be."""
    before, rest = PAGE.read_text().split(BEGIN)
    return f"{before}{BEGIN}\n\n{tables()}\n{END}{rest.split(END)[1]}"


if __name__ == "__main__":
    PAGE.write_text(page())
