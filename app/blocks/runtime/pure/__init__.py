"""Pure functions that programs call, one module per category.

The ``__all__`` of each module are names available to programs.
"""
