"""`python -m mapcli`."""

from mapcli.cli import main

main()
