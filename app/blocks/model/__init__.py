"""Blocks as data: a block's description, its fields and gaps, the workspace they form, the program."""
