"""The panels of Studio: each module binds one ``PANEL``; a new one is one new file.

`base` is what a panel is. A panel is named as its module, for saved layouts hold that name; its own parts
are in its folder, and it imports no other panel.
"""
