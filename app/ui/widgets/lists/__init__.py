"""Lists: entries with matches in bold, the search behind them, what scrolls."""
