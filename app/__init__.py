"""NEP Studio, the desktop program.

Rooms import downward: `ui`, `core`, `blocks`, `robots`, and `nep` below them. `app.__main__` has every entry.
"""
