"""Server side of the rosbridge v2 protocol, for web pages and programs."""
