"""Storage of settings and files, which are written atomically.

Used by behaviours, journals and versions; does not depend on them.
"""
