"""Reads a file in another process first: the HDF5 library may crash or hang on a damaged one."""

import contextlib
import math
import os
import select
import signal
import threading
from collections.abc import Callable
from pathlib import Path

from spurflex_postproc.layout import ResultError

SECONDS = 30.0
"""Time after which a small file should have been read."""
BYTES_PER_SECOND = 2e6
"""Slowest file system that larger files are granted."""
MEMORY = 16 * 2**30
"""Address space beside that in use and eight times the file [bytes]; nonsense asks for more."""
ENOUGH, TOO_LARGE = 0, 3


def rehearse(path: Path, read: Callable[[Path], object]) -> None:
    """Let a child process read a file, and see whether it comes through.

    What `read` itself raises is not told: it will raise it again. Where processes cannot be forked,
    nothing is done; nor with other threads about, whose locks the child would wait for.

    Args:
        path: The file.
        read: Reads it.

    Raises:
        ResultError: If the child crashes, hangs or wants impossible amounts of memory.
    """
    if not path.is_file() or not hasattr(os, "fork") or threading.active_count() > 1:
        return
    size = path.stat().st_size
    seconds = SECONDS + size / BYTES_PER_SECOND
    ends, begins = os.pipe()
    child = os.fork()
    if child == 0:
        # Without its parent nobody would end it.
        signal.alarm(math.ceil(2.0 * seconds))
        _read_and_leave(path, read, _address_space() + MEMORY + 8 * size)
    os.close(begins)
    try:
        # The end of the pipe shows when the child has ended.
        ended, _, _ = select.select([ends], [], [], seconds)
        if not ended:
            raise ResultError(f"{path}: damaged: reading it comes to no end")
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        child = 0
    finally:
        os.close(ends)
        if child:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
    if code == TOO_LARGE:
        raise ResultError(f"{path}: damaged: something in it claims an impossible size")
    if code != ENOUGH:
        raise ResultError(f"{path}: damaged: the HDF5 library cannot read it")


def _address_space() -> int:
    """Return the address space of this process [bytes]; 0 where the system does not tell."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[0])
    except (OSError, ValueError, IndexError):
        return 0
    return pages * os.sysconf("SC_PAGE_SIZE")


def _read_and_leave(path: Path, read: Callable[[Path], object], memory: int) -> None:
    """Be the child: read, and end without any of the parent's business."""
    code = ENOUGH
    try:
        # Only where there is `fork` is there this module.
        import resource

        # Some systems refuse limits; then the child has none.
        with contextlib.suppress(OSError, ValueError):
            _, hard = resource.getrlimit(resource.RLIMIT_AS)
            if hard == resource.RLIM_INFINITY or hard > memory:
                resource.setrlimit(resource.RLIMIT_AS, (memory, hard))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        read(path)
    except MemoryError:
        code = TOO_LARGE
    except BaseException as cause:
        code = TOO_LARGE if isinstance(cause.__cause__, MemoryError) else ENOUGH
    finally:
        os._exit(code)
