"""A virtual table: its model, its look, its cells, its columns.

Panels describe `Column`s; no cell is a widget.
"""
