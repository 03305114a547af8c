"""Operations of rosbridge and payloads in ROS message shapes, as values and as JSON."""
