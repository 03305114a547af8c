"""Lists: entries with matches in bold, the search behind them, what scrolls.

The command palette and the table of shortcuts are lists of entries.
"""
