"""Table for many rows: model, view, cells and columns.

Panels describe `Column` objects; cells are painted and are no widgets.
"""
