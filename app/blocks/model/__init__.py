"""Data model of blocks: block descriptions, fields and gaps, the workspace, the program.

Plug-ins declare blocks, fields and categories; the compiler reads workspaces and creates programs.
"""
