"""Data model of blocks: block descriptions, fields and slots, the workspace, and the program.

Plug-ins declare blocks, fields and categories; the compiler reads workspaces and creates programs.
"""
