"""Pages and programs that speak the rosbridge v2 protocol."""
