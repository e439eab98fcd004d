"""YAML mappings, read so that every error names the file, the key and the line.

The YAML is composed into nodes, not constructed into Python objects: nodes know their lines,
numbers may be spelled as C++ programs write them (1e-3, nan), and no tag can run code.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from itertools import chain

import yaml

from mapcli.errors import FormatError
from mapcli.formats.number_pattern import NUMBER

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_MAX_DEPTH = 50
_NOT_FINITE = re.compile(r"([+-]?)\.?(nan|inf)", re.IGNORECASE)


class YamlMapping:
    """A mapping: key -> node. Values are taken by key and checked.

    The methods raise `FormatError` for a key that is missing or of another type; `expected` is
    the text about what would have been right.

    Attributes:
        file: for errors.
        nodes: the values by their keys.

    Raises:
        FormatError: a key is given twice.
    """

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
        """The mapping that a file holds.

        Raises:
            FormatError: broken YAML, nested too deeply, or not a mapping.
        """
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
        _refuse_alias_bombs(root, file)
        return cls(root, file)

    def error(
        self, key: str, problem: str, expected: str, node: yaml.Node | None = None
    ) -> FormatError:
        """The error to raise about a key, at the line of `node` or else of the key's value."""
        node = node or self.nodes.get(key) or self.root
        return FormatError(
            f"{key}: {problem}",
            file=self.file,
            where=f"line {node.start_mark.line + 1}",
            expected=expected,
        )

    def require(self, key: str, expected: str) -> yaml.Node:
        """The node under a key that must be there."""
        if key not in self.nodes:
            raise self.error(key, "key is missing", expected)
        return self.nodes[key]

    def text(self, key: str, expected: str) -> str:
        """A text that is not empty."""
        node = self.require(key, expected)
        if not isinstance(node, yaml.ScalarNode) or not node.value:
            raise self.error(key, "not a text" if node.value else "empty", expected)
        return str(node.value)

    def number(self, key: str, expected: str) -> float:
        """A finite number."""
        value = number_of(self.require(key, expected))
        if value is None or not math.isfinite(value):
            raise self.error(key, f"{shown(self.nodes[key])} is not a number", expected)
        return value

    def numbers(self, key: str, count: int, expected: str) -> list[float]:
        """A list of `count` numbers, each of which may be nan or infinite."""
        node = self.require(key, expected)
        values = [number_of(n) for n in node.value] if isinstance(node, yaml.SequenceNode) else []
        if len(values) != count or None in values:
            raise self.error(key, f"{shown(node)}", expected)
        return [value for value in values if value is not None]


def _refuse_deep_nesting(data: bytes, file: str) -> None:
    """Raise `FormatError` beyond `_MAX_DEPTH`: the C parser would overflow its stack.

    A map nests three levels.
    """
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
    """The number in a scalar node, nan and inf included, or None. YAML's own typing takes `1e-3`
    for a text."""
    text = str(node.value).strip() if isinstance(node, yaml.ScalarNode) else ""
    if NUMBER.fullmatch(text):
        return float(text)
    odd = _NOT_FINITE.fullmatch(text)
    return float(odd[1] + odd[2]) if odd else None


def shown(node: yaml.Node) -> str:
    """A node in an error message: a text of at most 40 characters, or what kind of node it is."""
    if isinstance(node, yaml.ScalarNode):
        return repr(node.value[:40])
    count = len(node.value) if isinstance(node.value, Sequence) else 0
    return f"a list of {count}" if isinstance(node, yaml.SequenceNode) else "a mapping"


_MOST_UNFOLDED, _UNFOLDED_SHARE = 1_000_000, 100
"""Values that aliases may make of a file: in all, or of each value that is written out."""


def _refuse_alias_bombs(root: yaml.Node, file: str) -> None:
    """Raise FormatError where aliases (`*name`) unfold a small file to very many values."""
    unfolded: dict[int, int] = {}

    def count(node: yaml.Node) -> int:
        if id(node) not in unfolded:
            unfolded[id(node)] = 1  # an alias within its own anchor
            inner = node.value if isinstance(node, yaml.CollectionNode) else ()
            parts = chain.from_iterable(inner) if isinstance(node, yaml.MappingNode) else inner
            unfolded[id(node)] = 1 + sum(count(part) for part in parts)
        return unfolded[id(node)]

    total = count(root)
    if total > max(_MOST_UNFOLDED, _UNFOLDED_SHARE * len(unfolded)):
        raise FormatError(
            f"aliases unfold {len(unfolded):,} values to {total:,}",
            file=file,
            expected="values written out",
        )
