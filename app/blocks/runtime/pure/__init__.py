"""What programs work out: pure functions, called by the blocks of one category each.

The ``__all__`` of each module are names that a program may use.
"""
