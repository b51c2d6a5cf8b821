"""Executable file `parent_death.py PARENT_PID SIGNAL COMMAND...`: run COMMAND and signal it when the parent dies.

The kernel sends SIGNAL however the parent dies, and also to a stopped child, which a pipe watched by the child cannot
achieve. The process replaces itself by COMMAND, so that the process table shows only COMMAND.
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
    """Make the kernel send `signal` to this process when `parent` dies; exit if `parent` has died already."""
    if ctypes.CDLL(None, use_errno=True).prctl(PR_SET_PDEATHSIG, signal) != 0:
        sys.exit(f"prctl: {os.strerror(ctypes.get_errno())}")
    if os.getppid() != parent:
        sys.exit(1)  # the parent died before prctl took effect


if __name__ == "__main__":
    main()
