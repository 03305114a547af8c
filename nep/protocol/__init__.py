"""Messages between nodes, and between nodes and the master, as Python values and as bytes.

Specification: `docs/wire.md`. Contains only pure functions and frozen values, and performs no I/O.
"""
