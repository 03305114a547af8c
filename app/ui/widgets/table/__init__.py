"""A virtual table: its model, its look, its cells, its columns."""
