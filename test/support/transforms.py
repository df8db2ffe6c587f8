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

"""The transform on /tf held against the odometry that it comes with."""

from nav_msgs.msg import Odometry
import numpy as np
import pytest
from tf2_msgs.msg import TFMessage


def check_transforms(messages: list[TFMessage], odometry: list[Odometry],
                     frames: tuple[str, str]) -> None:
    """Show that 50 transforms a second have the odometry's poses, stamp by stamp.

    Args:
        messages: of /tf, on which others may publish, too.
        odometry: of the same time, about as much.
        frames: parent and child.

    """
    found = {stamp(one): one.transform for message in messages for one in message.transforms
             if (one.header.frame_id, one.child_frame_id) == frames}
    both = [(found[stamp(one)], one.pose.pose) for one in odometry if stamp(one) in found]
    assert len(both) > 0.8 * len(found) > 0
    times = np.array([sec + 1e-9 * nanosec for sec, nanosec in sorted(found)])
    assert np.median(np.diff(times)) == pytest.approx(0.02, abs=1e-6)
    for transform, pose in both:
        for at, place in ((transform.translation, pose.position),
                          (transform.rotation, pose.orientation)):
            for axis in place.get_fields_and_field_types():
                assert getattr(at, axis) == pytest.approx(getattr(place, axis), abs=1e-12)


def stamp(message) -> tuple[int, int]:
    """Return the time of a message in s and ns."""
    return message.header.stamp.sec, message.header.stamp.nanosec
