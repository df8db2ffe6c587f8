# Copyright 2026 cpg_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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
