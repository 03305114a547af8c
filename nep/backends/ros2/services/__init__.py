"""Services of the back end ros2: servers and clients, what they have in DDS, and the definitions of types."""
