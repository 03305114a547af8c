"""The categories of blocks: one module each, binding ``CATEGORY``; `nep.plugins.discover` finds them."""
