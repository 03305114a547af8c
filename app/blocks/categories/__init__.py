"""The categories of blocks: one module each, binding ``CATEGORY``; found by `nep.system.plugins`.

The category `robot` makes its blocks from robots' descriptions; docs/blocks.md says how to add a category.
"""
