#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Process 1 in the virtual machine of netem_vm.sh: sets up devices and modules, runs the command, and powers off.
export PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin HOME=/run PYTHONDONTWRITEBYTECODE=1
mount -t proc proc /proc
mount -t sysfs sysfs /sys
mount -t devtmpfs dev /dev 2>/dev/null
command=$(cat "$VM_SCRATCH/command")
mount -t tmpfs tmpfs /run
# The host's /tmp is read-only and may contain the project, so nothing is mounted over it.
mkdir -p /run/out /run/netns /run/tmp
export TMPDIR=/run/tmp
mount -t hostfs none /run/out -o "$VM_OUT"
mount -t cgroup2 none /sys/fs/cgroup
ip link set lo up
[ -n "$VM_BIN" ] && export SLAMBED_BIN="$VM_BIN"
cd "$(dirname "$0")/.." || exit 1
"$VM_PYTHON" - "$VM_MODULES" <<'END'
import ctypes, os, sys
FINIT_MODULE = 313  # x86-64; there may be no insmod
for name in ("net/sched/sch_netem.ko", "drivers/net/veth.ko"):
    try:
        fd = os.open(f"{sys.argv[1]}/{name}", os.O_RDONLY)
        if ctypes.CDLL(None, use_errno=True).syscall(FINIT_MODULE, fd, b"", 0) != 0:
            raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    except OSError as error:
        sys.exit(f"cannot load {name}: {error.strerror}")
END
loaded=$?
echo SLAMBED_VM_READY
# Without the modules, tests that need them would be skipped and look passed.
if [ $loaded -eq 0 ]; then
  sh -c "$command"
  echo "SLAMBED_VM_RESULT $?"
fi
"$VM_PYTHON" -c 'import ctypes, os; os.sync(); ctypes.CDLL(None).reboot(0x4321FEDC)'
