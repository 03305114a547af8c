"""Pure functions that programs call, one module for each category.

The names in ``__all__`` of each module are available to programs.
"""
