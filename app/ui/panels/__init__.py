"""Panels of Studio. Each module binds one ``PANEL``; to add a panel, add a module.

`base` has the base class. A panel's name is that of its module, because saved layouts contain it. Its parts
are in a package of the same name. Panels don't import each other.
"""
