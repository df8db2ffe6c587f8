"""Physics: a robot's body in MuJoCo, pictures of it and of its footfalls. Knows nothing of ROS."""
