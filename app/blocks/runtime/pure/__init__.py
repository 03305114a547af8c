"""Functions that programs call and that don't depend on robots or topics, one module per category.

The names in ``__all__`` of each module are available to programs.
"""
