"""What nodes and the master say to each other, as values and as bytes: the specification is `docs/wire.md`.

Pure functions and frozen values; nothing here has a socket or a clock.
"""
