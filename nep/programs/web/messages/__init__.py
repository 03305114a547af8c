"""Operations of rosbridge, and conversion of payloads to ROS message shapes."""
