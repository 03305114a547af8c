"""Linux: a .deb, and a .tar.xz that unpacks and starts anywhere."""
