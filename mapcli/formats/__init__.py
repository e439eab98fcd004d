"""Reading and writing files, one module per format, reader and writer together.

    maps        grid maps: text, YAML, PGM, PNG (`load`, `save`)
    logs        recordings of robots: CARMEN, MCAP with ROS messages (`open_log`)
    documents   everything else: pose traces, trajectories, perceptions, worlds, tables
    input.py    the bytes of a file or of standard input
    output.py   the one writer of every output

Every exception of a foreign library becomes a `FormatError` here and nowhere else.
"""
