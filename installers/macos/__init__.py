"""Package for macOS: an application in a disk image, signed if an identity is given."""
