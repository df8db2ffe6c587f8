"""The bridge to Unitree's robots: its node, its start, what it publishes, its watchdog."""

__all__ = ['bridge', 'interfaces', 'parameters', 'robot_graph', 'sensors', 'start', 'watchdog',
           'watchdog_link']
