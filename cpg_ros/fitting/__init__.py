"""From signals to what they are: period, mean cycle and symmetry. No ROS in here."""
