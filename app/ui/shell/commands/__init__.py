"""Command table, and the handlers that implement the commands on a `Shell`.

`Commands` is the entry point; menus and palette entries are built from the table.
"""
