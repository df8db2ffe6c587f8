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

"""Notice of compilations, before they begin; code that is loaded from disk is none."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from numba.core import event


class _Notice(event.Listener):
    """Calls a function when something is compiled."""

    def __init__(self, compiling: Callable[[], None]) -> None:
        self._compiling = compiling

    def on_start(self, event: event.Event) -> None:
        self._compiling()

    def on_end(self, event: event.Event) -> None:
        """Whatever follows has been announced."""


@contextmanager
def noticing(compiling: Callable[[], None]) -> Iterator[None]:
    """Call a function for each function that is not on disk yet, before it is compiled."""
    with event.install_listener('numba:compile', _Notice(compiling)):
        yield
