"""What the editor gets: the definitions of all blocks, the toolbox, and the help of each block."""
