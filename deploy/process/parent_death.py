"""Run as a file: become a command that does not outlive its parent. `parent_death.py PARENT_PID SIGNAL COMMAND...`

The kernel sends SIGNAL when the parent dies, however it dies, and also to a child that is stopped: a pipe that the
child would have to watch cannot do that. Replaces itself by COMMAND, so the process table shows only that.
"""

import ctypes
import os
import sys

PR_SET_PDEATHSIG = 1


def main() -> None:
    parent, signal, command = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:]
    die_with_parent(parent, signal)
    os.execv(command[0], command)


def die_with_parent(parent: int, signal: int) -> None:
    """Have the kernel send `signal` to this process when `parent` dies; ends it when that is so already."""
    if ctypes.CDLL(None, use_errno=True).prctl(PR_SET_PDEATHSIG, signal) != 0:
        sys.exit(f"prctl: {os.strerror(ctypes.get_errno())}")
    if os.getppid() != parent:
        sys.exit(1)  # it died before we asked to be told


if __name__ == "__main__":
    main()
