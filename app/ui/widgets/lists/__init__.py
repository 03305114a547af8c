"""Lists: entries with highlighted matches, fuzzy search, scroll areas, and a list next to details."""
