"""Compiler from a workspace to a program: templates filled with syntax trees, rendered as source and to run.

`compiler.compile_behaviour` is the entry point; `problems` has the sentences shown before Run.
"""
