"""What the editor gets: the definitions of all blocks, the toolbox, and the help of each block.

`catalogue` knows every block that there is now, in the toolbox's order: the `order` of each category.
"""
