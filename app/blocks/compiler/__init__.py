"""Compiler from a workspace to a program.

Templates are filled with syntax trees, from which readable source and executable code are generated.
`compiler.compile_behaviour` is the entry point; `problems` contains the messages shown before Run.
"""
