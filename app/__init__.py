"""NEP Studio, the desktop application.

Packages import downward: `ui`, `core`, `blocks`, `robots`, and `nep` below them. `app.__main__` contains
every entry point.
"""
