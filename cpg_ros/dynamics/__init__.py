"""Time stepping, simulation, orbits, Hopf points and the moving pattern: no ROS in here."""
