"""Panels of Studio: a module or package that binds ``PANEL`` is a panel. To add a panel, add a module.

`base` contains the base class. A panel's name is the name of its module, because saved layouts contain
it. The parts of a panel are in a package of the same name. Modules without ``PANEL`` contain what several
panels share. Panels don't import each other.
"""
