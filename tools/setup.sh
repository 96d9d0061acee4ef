#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# setup.sh run|live|build|test|browser|bench|fuzz|image|arm64 ...: installs the missing Debian/Ubuntu packages of these groups.
set -euo pipefail

packages_for() {
  case $1 in
    run) echo python3 python3-venv ca-certificates ;;
    live) echo iproute2 openssh-client ;;
    # With ccache nothing is compiled twice, not even in another clone.
    build) echo g++ cmake ninja-build ccache libeigen3-dev nlohmann-json3-dev libcli11-dev zlib1g-dev libturbojpeg0-dev ;;
    # OpenCV and Ceres are oracles of the tests; no program links them. OpenCV's CMake files are only in
    # its full package. Tests start the ssh server themselves, on a loopback port.
    test) echo libgtest-dev libopencv-dev libceres-dev openssh-server ;;
    # Only for make test-browser: several hundred megabytes.
    browser) echo chromium ;;
    bench) echo libbenchmark-dev ;;
    fuzz) echo clang "$(clang_runtime)" ;;
    image) echo debootstrap debian-archive-keyring ;;
    # Programs for arm64 run as if they were this machine's.
    arm64) echo qemu-user-static binfmt-support binutils-aarch64-linux-gnu ;;
    *) echo "error: setup.sh $1: not one of run, live, build, test, browser, bench, fuzz, image, arm64" >&2; exit 2 ;;
  esac
}

# The package of clang only recommends the runtime of its sanitizers and fuzzer, whose package name has clang's version.
clang_runtime() {
  apt-cache depends clang 2>/dev/null | sed -n 's/.*Depends: clang-\([0-9]*\)$/libclang-rt-\1-dev/p'
}

installed() {
  [ "$(dpkg-query -W -f '${db:Status-Status}' "$1" 2>/dev/null)" = installed ]
}

# A Python that dpkg does not know is fine too.
python_is_good() {
  python3 -c 'import ensurepip, sys, venv; sys.exit(sys.version_info < (3, 11))' 2>/dev/null
}

missing=()
for group in "$@"; do
  packages=$(packages_for "$group")
  for package in $packages; do
    case $package in
      python3 | python3-venv) python_is_good && continue ;;
    esac
    installed "$package" || missing+=("$package")
  done
done
[ ${#missing[@]} -eq 0 ] && exit 0

if ! command -v apt-get >/dev/null; then
  echo "error: no apt-get on this system; install the equivalent of: ${missing[*]}" >&2
  exit 3
fi
sudo=
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || { echo "error: no sudo; as root: apt-get install ${missing[*]}" >&2; exit 3; }
  sudo=sudo
fi
bash "$(dirname "$0")/space.sh" 1500 "installing ${#missing[@]} packages"
echo "installing: ${missing[*]}"

# apt_get ARGUMENT ...: waits up to apt_wait_s for another apt (a new machine updates itself). Other failures, such as a mirror
# that does not answer or a package folder that another apt has emptied, are retried up to three times.
apt_wait_s=${SLAMBED_APT_WAIT_S:-600}
apt_pause_s=${SLAMBED_APT_PAUSE_S:-10}
apt_get() {
  local told= attempt=1 output
  until output=$($sudo env LC_ALL=C DEBIAN_FRONTEND=noninteractive apt-get -qq "$@" 2>&1 >/dev/null); do
    if ! grep -q "Could not get lock\|Unable to lock\|Unable to acquire the dpkg" <<<"$output"; then
      if [ "$attempt" -lt 3 ]; then
        attempt=$((attempt + 1))
        echo "apt-get $1 failed; attempt $attempt of 3 in $apt_pause_s s"
        sleep "$apt_pause_s"
        continue
      fi
      echo "$output" >&2
      echo "error: apt-get $1 failed three times; see the lines above, check the network" >&2
      exit 3
    fi
    if [ "$SECONDS" -ge "$apt_wait_s" ]; then
      echo "error: another apt has held its lock for $apt_wait_s s; end it and repeat" >&2
      exit 3
    fi
    [ -n "$told" ] || echo "waiting for another apt to end"
    told=yes
    sleep 2
  done
  [ -z "$output" ] || echo "$output" >&2
}
apt_get update
apt_get install -y --no-install-recommends "${missing[@]}"
