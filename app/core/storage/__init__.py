"""Storage: settings and files, written atomically.

Used by behaviours, journals and versions, which it doesn't depend on.
"""
