"""Executable ``inversion``: a recording inverted at once, or live joint states on call."""

import sys

from cpg_ros.tools import inversion


def main(args: list[str] | None = None) -> int:
    """Invert the recording that is named, or run the node; return the exit code."""
    given = sys.argv[1:] if args is None else args
    if given and given[0] != '--ros-args':
        return inversion.main(given)
    # Without ROS installed, recordings can be inverted all the same.
    from cpg_ros.nodes.inversion_node import run
    return run(args)


if __name__ == '__main__':
    sys.exit(main())
