"""Lists: entries with matches in bold, the search behind them, rows that fill a panel."""
