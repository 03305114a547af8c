"""What makes NEP Studio's packages: one PyInstaller specification for all systems, and a packer for each.

`python3 dev.py package` runs `installers.package`; docs/release.md says how a release is made.
"""
