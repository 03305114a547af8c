"""Packaging of NEP Studio: one PyInstaller specification for all systems, and a packer for each.

`python3 dev.py package` runs `installers.package`; docs/release.md describes releases.
"""
