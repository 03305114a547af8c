"""The block editor's web page as a widget, and what window and page say to each other."""
