# SPDX-License-Identifier: Apache-2.0
"""The process that becomes a node of the local engine: sets limits and namespace, then waits at a
start barrier.

Run as `python launcher.py PARENT_PID READY_FD[,NETWORK_FD] UID[,FILE_BYTES] TASKS_FILE... --
PROGRAM ...`. NETWORK_FD is a namespace to enter; without it the node gets a new one. FILE_BYTES is
the largest size of a file, also of one that nobody counts: elsewhere, or deleted while open. This
module imports nothing of slambed, so that it starts fast. It writes one byte to READY_FD when
everything is in place, and waits for one byte before it executes the program. It exits if its input
ends.
"""

import ctypes
import fcntl
import os
import resource
import signal
import socket
import struct
import sys

CLONE_NEWNET = 0x40000000
PR_SET_PDEATHSIG = 1
PR_SET_KEEPCAPS = 8
PR_CAPBSET_READ = 23
PR_CAPBSET_DROP = 24
PR_SET_NO_NEW_PRIVS = 38
PR_CAP_AMBIENT = 47
PR_CAP_AMBIENT_RAISE = 2
LINUX_CAPABILITY_VERSION_3 = 0x20080522
SIOCSIFFLAGS = 0x8914
IFF_UP = 1
# The only privilege of a node: to read a sequence in a private home folder.
CAP_DAC_READ_SEARCH = 2
LAST_CAPABILITY_TRIED = 63
libc = ctypes.CDLL(None, use_errno=True)


def check(result: int, what: str) -> None:
    """Raises OSError if the kernel refused."""
    if result != 0:
        raise OSError(ctypes.get_errno(), f"{what}: {os.strerror(ctypes.get_errno())}")


def main() -> None:
    parent = int(sys.argv[1])
    split = sys.argv.index("--")
    ready_fd, *network_fd = map(int, sys.argv[2].split(","))
    uid, *file_bytes = map(int, sys.argv[3].split(","))
    tasks_files, program = sys.argv[4:split], sys.argv[split + 1 :]
    for path in tasks_files:
        with open(path, "w") as tasks:  # noqa: PTH123 - pathlib costs start-up time here
            tasks.write(str(os.getpid()))
    if network_fd:
        check(libc.setns(network_fd[0], CLONE_NEWNET), "setns(CLONE_NEWNET)")
        os.close(network_fd[0])
    else:
        check(libc.unshare(CLONE_NEWNET), "unshare(CLONE_NEWNET)")
        bring_up_loopback()
    if file_bytes:
        resource.setrlimit(resource.RLIMIT_FSIZE, (file_bytes[0], file_bytes[0]))
    drop_capabilities()
    become(uid)
    # A node must not outlive the harness, however it dies. Set after the user change, which clears
    # it.
    check(libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0), "PR_SET_PDEATHSIG")
    if os.getppid() != parent:
        sys.exit(1)
    check(libc.prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0), "PR_SET_NO_NEW_PRIVS")

    os.write(ready_fd, b"r")
    os.close(ready_fd)
    if os.read(0, 1) != b"g":
        sys.exit(1)
    null = os.open("/dev/null", os.O_RDONLY)
    os.dup2(null, 0)
    try:
        os.execv(program[0], program)
    except OSError as error:
        sys.exit(refused(f"cannot start the node: {error.strerror}, {program[0]}"))


def refused(line: str) -> int:
    """Prints the error; returns the exit code for an environment error."""
    print(f"error: {line}", file=sys.stderr)
    return 3


def bring_up_loopback() -> None:
    """Brings up lo, like in a container."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as handle:
        request = struct.pack("16sh14x", b"lo", IFF_UP)
        fcntl.ioctl(handle, SIOCSIFFLAGS, request)


def become(uid: int) -> None:
    """Changes the user, keeping the read capability across the next exec."""
    check(libc.prctl(PR_SET_KEEPCAPS, 1, 0, 0, 0), "PR_SET_KEEPCAPS")
    os.setgroups([])
    os.setresgid(uid, uid, uid)
    os.setresuid(uid, uid, uid)
    right = 1 << CAP_DAC_READ_SEARCH
    header = struct.pack("Ii", LINUX_CAPABILITY_VERSION_3, 0)
    # Effective, permitted, inheritable: first the lower 32 capabilities, then the others.
    check(libc.capset(header, struct.pack("6I", right, right, right, 0, 0, 0)), "capset")
    raised = libc.prctl(PR_CAP_AMBIENT, PR_CAP_AMBIENT_RAISE, CAP_DAC_READ_SEARCH, 0, 0)
    check(raised, "PR_CAP_AMBIENT_RAISE")


def drop_capabilities() -> None:
    """Drops all other capabilities from the bounding set, so that no exec can regain them."""
    for capability in range(LAST_CAPABILITY_TRIED + 1):
        known = libc.prctl(PR_CAPBSET_READ, capability, 0, 0, 0) >= 0
        if known and capability != CAP_DAC_READ_SEARCH:
            libc.prctl(PR_CAPBSET_DROP, capability, 0, 0, 0)


if __name__ == "__main__":
    main()
