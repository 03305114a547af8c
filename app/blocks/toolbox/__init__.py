"""Data for the editor: definitions of all blocks, the toolbox, and the help of each block.

`catalogue` knows every block that exists now, in the order of the categories.
"""
