"""Storage: settings and files, written atomically.

Used by behaviours, journals and versions; does not depend on them.
"""
