"""Services of the back end `ros2`: servers, clients, their DDS endpoints, and service types."""
