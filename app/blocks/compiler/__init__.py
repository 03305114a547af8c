"""Compiler from the pages of a project to one program.

Templates are filled with syntax trees, from which readable source and executable code are generated
(`page_compiler`), and the code of the pages is put together (`linker`). `compiler` is the entry point.
"""
