"""Lists: entries with highlighted matches, fuzzy search, and scroll areas."""
