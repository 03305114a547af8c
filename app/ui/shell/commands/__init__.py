"""The table of commands, and what they do with a window, which they know as a `Shell`.

`Commands` is the way in; menus and the palette's entries are made from the table.
"""
