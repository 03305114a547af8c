"""What the project itself needs: checks, benchmarks, pictures, environment. No part of what is installed."""
