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

"""An executor over another one that can be made anew when it breaks."""

from collections.abc import Callable
from concurrent.futures import CancelledError, Executor, Future
from concurrent.futures.process import BrokenProcessPool
from typing import Any

#: Jobs that are handed to an executor at the same time, where it does not say how many.
ROOM = 8


class RenewableExecutor(Executor):
    """An executor that survives the loss of its workers.

    Attributes:
        inner: that which runs the jobs now.
        room: jobs that are handed to it at the same time.

    """

    def __init__(self, inner: Executor, room: int = ROOM,
                 renew: Callable[[], tuple[Executor, int]] | None = None,
                 close: Callable[[bool], None] | None = None) -> None:
        """Run jobs with an executor.

        Args:
            inner: the executor.
            room: jobs that are handed to it at the same time.
            renew: makes another one like it and says how many jobs it has room for; without it a
                broken one ends the work.
            close: lets go of the workers; waits for jobs that are under way if it is given True.

        """
        self.inner, self.room = inner, room
        self._renew, self._close = renew, close

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **options: Any
               ) -> Future[Any]:
        """Hand a job over."""
        return self.inner.submit(function, *arguments, **options)

    def lost(self, error: BaseException) -> bool:
        """Whether an error tells of the executor and not of the job."""
        return self._renew is not None and isinstance(error, BrokenProcessPool | CancelledError)

    def renew(self) -> None:
        """Replace an executor that broke.

        Raises:
            NoCluster: a scheduler does not come back.

        """
        assert self._renew is not None
        self.inner, self.room = self._renew()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Let go of the workers, without waiting for jobs that are under way if wait is False."""
        if self._close is not None:
            self._close(wait)
