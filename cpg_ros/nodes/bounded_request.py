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

"""Requests of a service whose first field is a sequence, bounded in length.

rclpy converts every request to Python objects at once: for 100,000 parameters that takes 5 s and
leaves millions of objects to the garbage collector, whatever the service then answers.
"""

import ctypes
from typing import Any

from rclpy.type_support import check_for_type_support

#: PyObject * convert(void * message), as the type support of every message has it.
_CONVERT = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p)
_pointer, _capsule = ctypes.pythonapi.PyCapsule_GetPointer, ctypes.pythonapi.PyCapsule_New
_pointer.restype, _pointer.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
_capsule.restype = ctypes.py_object
_capsule.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]
#: A capsule must not outlive what it points to.
_kept: list[Any] = []


def bounded(service: type, most: int) -> type:
    """Return a type to take instead of a service's Request.

    Taken is a Request or, if its first field has more than ``most`` elements, their number.

    Args:
        service: type of a service whose requests begin with a sequence.
        most: largest number of elements.

    """
    check_for_type_support(service)
    kind: Any = type(service.Request)  # type: ignore[attr-defined]
    usual = _CONVERT(_pointer(kind._CONVERT_TO_PY, None))

    def convert(message: int) -> object:
        # In C a sequence is a pointer to its elements, then how many there are.
        length = ctypes.c_size_t.from_address(message + ctypes.sizeof(ctypes.c_void_p)).value
        return length if length > most else usual(message)

    own = _CONVERT(convert)
    _kept.append(own)
    names = '_CREATE_ROS_MESSAGE', '_DESTROY_ROS_MESSAGE', '_CONVERT_FROM_PY', '_TYPE_SUPPORT'
    support = type('Support', (type,), {
        **{name: getattr(kind, name) for name in names},
        '_CONVERT_TO_PY': _capsule(ctypes.cast(own, ctypes.c_void_p), None, None)})
    bound: type = support('Request', (), {})
    return bound
