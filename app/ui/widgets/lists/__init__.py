"""Lists: entries with highlighted matches, fuzzy search, scroll areas.

The command palette and the table of shortcuts use them.
"""
