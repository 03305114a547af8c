"""Types of ROS messages and services, shared by the back ends `ros` and `ros2`. Needs no ROS installation."""
