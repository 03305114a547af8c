"""What a robot can do and tell: its W3C Thing Model, parsed once into typed values, and inputs checked."""
