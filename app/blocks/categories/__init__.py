"""Categories of blocks: one module each, which binds ``CATEGORY``; discovered by `nep.system.plugins`.

The category `robot` creates its blocks from robot descriptions; docs/blocks.md describes how to add a
category.
"""
