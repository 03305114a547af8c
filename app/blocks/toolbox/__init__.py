"""Data for the editor: definitions of all blocks, the toolbox, and the help of each block.

`catalogue` contains all available blocks, in the order of the categories.
"""
