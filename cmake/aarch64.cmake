# SPDX-License-Identifier: Apache-2.0
# Toolchain file: builds for aarch64 (arm64) on a Debian of another architecture, and runs the tests under QEMU's emulation.
# tools/arm64.sh installs what it needs.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64-static)
