"""`python -m mapcli`."""

from mapcli.cli import run

run()
