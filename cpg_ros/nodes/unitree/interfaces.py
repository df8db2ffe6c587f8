"""Unitree's message types, or one line that says how to get them."""

import sys
from importlib import import_module
from pathlib import Path

import rclpy

from cpg_ros.errors import MissingLibraryError


def message(name: str) -> type:
    """Return a message type, such as ``unitree_go/LowCmd``.

    Raises:
        MissingLibraryError: its package is not there; says how to get it.

    """
    package, kind = name.split('/')
    try:
        return getattr(import_module(f'{package}.msg'), kind)
    except ImportError as error:
        wheels = Path(rclpy.__file__).is_relative_to(sys.prefix)
        raise MissingLibraryError(
            f'the messages of {package} are not there ({error}): ' + (
                "'make unitree' builds them" if wheels else
                'build unitree_go and unitree_api of '
                'https://github.com/unitreerobotics/unitree_ros2 with colcon, and source that '
                'workspace')) from error
