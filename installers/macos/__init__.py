"""The package for macOS: an application in a disk image, signed when the owner's name is given."""
