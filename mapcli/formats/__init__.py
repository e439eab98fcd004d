"""Files in and out: one module per format, reader and writer together.

Every foreign exception becomes a `FormatError` here and nowhere else.
"""
