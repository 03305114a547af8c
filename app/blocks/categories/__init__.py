"""The categories of blocks: one module each, binding ``CATEGORY``; found by `nep.system.plugins`."""
