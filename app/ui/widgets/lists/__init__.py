"""Lists: entries with highlighted matches, fuzzy search, scroll areas.

Used by the command palette and the table of shortcuts.
"""
