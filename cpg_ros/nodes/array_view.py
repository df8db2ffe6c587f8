"""Arrays of numbers in messages, written where they are published from."""

from array import array

import numpy as np


def view_of(message: object, field: str, n: int) -> np.ndarray:
    """Give a message's field n zeros and return a numpy view of the memory it publishes from.

    The view is taken from the field as stored: rclpy copies what is assigned or not, depending
    on whether it checks fields.
    """
    setattr(message, field, array('d', bytes(8 * n)))
    return np.frombuffer(getattr(message, field), dtype=float)
