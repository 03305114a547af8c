"""Blocks as data, and the compiler from pages of blocks to a Python program.

`compiler` contains the compiler, `toolbox` the definitions for the editor, and `model` the blocks as data.
Exported programs import `commands`. ``editor/`` contains the editor's page in TypeScript.
"""
