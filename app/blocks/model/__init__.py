"""Blocks as data: a block's description, its fields and gaps, the workspace they form, the program.

Block, field and category are what plug-ins declare; workspace and program are what the compiler reads and
makes.
"""
