"""Packages for Linux: a .deb, and a .tar.xz that runs from any folder."""
