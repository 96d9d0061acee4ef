#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Runs a command as root inside a small virtual machine whose kernel has netem and cgroup v2. It is user-mode Linux, an
# ordinary program that boots on this host's own files (read-only). Needed where the host's kernel lacks sch_netem or has
# cgroup v1.
#
#   tools/netem_vm.sh [--out FOLDER] [command ...]     default command: the tests of netem and cgroup v2
#
# The command sees FOLDER, writable, as /run/out. Exit status: the command's; 77 if this host cannot run such a machine,
# with one line that says why; 78 if it lacks netem, died or took longer than SLAMBED_VM_SECONDS.
set -euo pipefail
cd "$(dirname "$0")/.."
repository=$PWD
cache=${SLAMBED_CACHE:-${XDG_CACHE_HOME:-$HOME/.cache}/slambed}/uml
memory=${SLAMBED_VM_MEMORY:-1024M}
# Far longer than the tests take on an idle host.
limit_s=${SLAMBED_VM_SECONDS:-540}

no_machine() { echo "no virtual machine: $1" >&2; exit 77; }

out=
if [ "${1:-}" = --out ]; then out=$(mkdir -p "$2" && cd "$2" && pwd); shift 2; fi
if [ $# -eq 0 ]; then
  set -- .venv/bin/python -m pytest --color=no -p no:cacheprovider harness/tests/link/test_link_backends.py \
    harness/tests/engines/test_thread_caps.py harness/tests/sampling/test_sampling_cgroup.py
fi

# The package is only unpacked, not installed, so it changes nothing on the host.
if [ ! -x "$cache/usr/bin/linux.uml" ]; then
  [ "$(uname -m)" = x86_64 ] || no_machine "user-mode Linux is for x86-64, this is $(uname -m)"
  command -v apt-get dpkg > /dev/null || no_machine "the package user-mode-linux is Debian's, and there is no apt-get"
  mkdir -p "$cache"
  (cd "$cache" && apt-get -qq download user-mode-linux 2> /dev/null) ||
    no_machine "cannot download the package user-mode-linux; 'apt-get update' may help"
  dpkg -x "$cache"/user-mode-linux_*.deb "$cache"
  rm "$cache"/user-mode-linux_*.deb
fi
modules=$(echo "$cache"/usr/lib/uml/modules/*/kernel)

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
out=${out:-$scratch/out}
mkdir -p "$out"
printf '%q ' "$@" > "$scratch/command"
log=$scratch/console
# What the machine needs to know stands in a file, because blanks divide its kernel's command line.
{
  echo '#!/bin/bash'
  printf 'export VM_SCRATCH=%q VM_OUT=%q VM_MODULES=%q VM_PYTHON=%q VM_BIN=%q\nexec %q\n' "$scratch" "$out" "$modules" \
    "$repository/.venv/bin/python" "${SLAMBED_BIN:-}" "$repository/tools/netem_vm_init.sh"
} > "$scratch/init"
chmod 755 "$scratch/init"

# The machine's console is our standard output. It always exits with 0, so the result is a line on the console. Its one CPU
# is an ordinary process, which gets a high priority if permitted, because otherwise measured delays mean nothing.
first=$(nice -n -20 true 2>/dev/null && echo "nice -n -20" || true)
TMPDIR=$scratch $first timeout --kill-after=5 "$limit_s" "$cache/usr/bin/linux.uml" \
  "mem=$memory" root=none rootfstype=hostfs rootflags=/ ro quiet \
  con=null con0=null,fd:1 ssl=null "umid=slambed$$" "uml_dir=$scratch" \
  "init=$scratch/init" \
  < /dev/null 2>&1 | tee "$log" | sed -u -n '/^SLAMBED_VM_READY/,/^SLAMBED_VM_RESULT/{/^SLAMBED_VM_/!p}' || true
if ! grep -q '^SLAMBED_VM_READY' "$log"; then
  # It cannot restore the registers of a processor whose state (AMX) is larger than its kernel's buffer.
  if grep -q put_fp_registers "$log"; then no_machine "this processor's registers are more than user-mode Linux knows"; fi
  no_machine "user-mode Linux does not start here: $(tail -n 1 "$log")"
fi
result=$(sed -n 's/^SLAMBED_VM_RESULT \([0-9]*\).*/\1/p' "$log" | tail -1)
if [ -z "$result" ]; then
  lacks=$(sed -n 's/^\(cannot load .*\)/; \1/p' "$log")
  echo "error: the virtual machine ended without a result (limit: $limit_s s)$lacks" >&2
  exit 78
fi
exit "$result"
