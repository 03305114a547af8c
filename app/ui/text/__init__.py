"""Values as people read them: numbers, dates, a robot's sensors."""
