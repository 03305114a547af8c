"""Categories of blocks. Each module binds ``CATEGORY`` and is discovered by `nep.system.plugins`.

The category `robot` creates its blocks from robot descriptions. docs/blocks.md describes how to add a
category.
"""
