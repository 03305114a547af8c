"""Virtual table: model, view, cells, columns.

Panels describe `Column`s; cells are painted and are no widgets.
"""
