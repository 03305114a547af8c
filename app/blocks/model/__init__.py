"""Data model of blocks: block descriptions, fields and slots, workspaces, and programs.

Plug-ins declare blocks, fields and categories; the compiler reads workspaces and creates programs.
"""
