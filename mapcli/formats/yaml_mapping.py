"""YAML mappings, read so that every complaint can name the key and the line.

Documents are composed, not constructed: nodes know their lines, numbers are spelled as in files
of C++ programs (1e-3, nan), and no tag can make anything run.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import yaml

from mapcli.errors import FormatError
from mapcli.formats.number_pattern import NUMBER

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_MAX_DEPTH = 50
_NOT_FINITE = re.compile(r"([+-]?)\.?(nan|inf)", re.IGNORECASE)


class YamlMapping:
    """The keys of a YAML mapping, with errors that name file, key and line."""

    def __init__(self, root: yaml.MappingNode, file: str) -> None:
        self.file = file
        self.root = root
        self.nodes: dict[str, yaml.Node] = {}
        for key, value in root.value:
            name = str(key.value) if isinstance(key, yaml.ScalarNode) else ""
            if name in self.nodes:
                raise self.error(name, "given twice", "each key once", node=key)
            self.nodes[name] = value

    @classmethod
    def parse(cls, data: bytes, file: str) -> YamlMapping:
        """Compose without constructing: nodes know their lines, and nothing is executed."""
        try:
            _refuse_deep_nesting(data, file)
            root = yaml.compose(data.decode("utf-8-sig", "replace"), Loader=_LOADER)
        except (yaml.YAMLError, ValueError, RecursionError) as error:
            mark = getattr(error, "problem_mark", None)
            raise FormatError(
                f"broken YAML: {getattr(error, 'problem', None) or error}",
                file=file,
                where=f"line {mark.line + 1}" if mark else None,
            ) from error
        if not isinstance(root, yaml.MappingNode):
            raise FormatError("not a YAML mapping", file=file, expected="`key: value` lines")
        return cls(root, file)

    def error(
        self, key: str, problem: str, expected: str, node: yaml.Node | None = None
    ) -> FormatError:
        node = node or self.nodes.get(key) or self.root
        return FormatError(
            f"{key}: {problem}",
            file=self.file,
            where=f"line {node.start_mark.line + 1}",
            expected=expected,
        )

    def require(self, key: str, expected: str) -> yaml.Node:
        if key not in self.nodes:
            raise self.error(key, "key is missing", expected)
        return self.nodes[key]

    def text(self, key: str, expected: str) -> str:
        node = self.require(key, expected)
        if not isinstance(node, yaml.ScalarNode) or not node.value:
            raise self.error(key, "not a text" if node.value else "empty", expected)
        return str(node.value)

    def number(self, key: str, expected: str) -> float:
        value = number_of(self.require(key, expected))
        if value is None or not math.isfinite(value):
            raise self.error(key, f"{shown(self.nodes[key])} is not a number", expected)
        return value

    def numbers(self, key: str, count: int, expected: str) -> list[float]:
        node = self.require(key, expected)
        values = [number_of(n) for n in node.value] if isinstance(node, yaml.SequenceNode) else []
        if len(values) != count or None in values:
            raise self.error(key, f"{shown(node)}", expected)
        return [value for value in values if value is not None]


def _refuse_deep_nesting(data: bytes, file: str) -> None:
    """A map nests three deep; the C parser of a file of brackets would overflow its stack."""
    depth = 0
    for event in yaml.parse(data.decode("utf-8-sig", "replace"), Loader=_LOADER):
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > _MAX_DEPTH:
            raise FormatError(
                f"lists nested deeper than {_MAX_DEPTH}",
                file=file,
                expected="a map",
            )


def number_of(node: yaml.Node) -> float | None:
    """The number a scalar spells, nan and inf included; YAML's own typing would miss 1e-3."""
    text = str(node.value).strip() if isinstance(node, yaml.ScalarNode) else ""
    if NUMBER.fullmatch(text):
        return float(text)
    odd = _NOT_FINITE.fullmatch(text)
    return float(odd[1] + odd[2]) if odd else None


def shown(node: yaml.Node) -> str:
    if isinstance(node, yaml.ScalarNode):
        return repr(node.value[:40])
    count = len(node.value) if isinstance(node.value, Sequence) else 0
    return f"a list of {count}" if isinstance(node, yaml.SequenceNode) else "a mapping"
