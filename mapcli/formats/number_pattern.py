"""The pattern of a decimal number, as in text maps and YAML."""

from __future__ import annotations

import re

NUMBER = re.compile(r"[+-]?(\d++(\.\d*+)?|\.\d++)([eE][+-]?\d++)?", re.ASCII)
"""Digits once matched are not given back: long numbers that are none would take time squared."""
