"""Panels of Studio: each module defines one ``PANEL``. To add a panel, add a module.

`base` contains the base class. A panel's name is the name of its module, because saved layouts contain
it. The parts of a panel are in a package of the same name. Panels don't import each other.
"""
