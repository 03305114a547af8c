"""What nodes do beside topics: services and surveys, parameters."""
