"""Panels of Studio. Each module binds one ``PANEL``; a new panel is one new module.

`base` has the base class. A panel has the name of its module, because saved layouts contain it. Its parts are
in its package, and it imports no other panel.
"""
