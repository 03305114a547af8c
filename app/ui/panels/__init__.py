"""Panels of Studio, in a folder for each kind of work. To add a panel, add a module to a folder.

A module or package in a folder that binds ``PANEL`` is a panel; no other edit is needed. The description
contains its home in the layouts, its commands and the intents that it handles. A panel's name is the name of
its module, because saved layouts contain it. The parts of a panel are in a package of the same name. `base`
contains the base class; the other modules here, and modules without ``PANEL``, contain what several panels
share. Panels don't import each other.
"""
