"""Messages between nodes and the master, as values and as bytes. Specification: `docs/wire.md`.

Pure functions and frozen values, without sockets or clocks.
"""
