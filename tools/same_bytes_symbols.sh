#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# same_bytes_symbols.sh LIBRARY...: refuses static libraries whose results depend on the processor.
# It checks the object code, because Eigen and the standard library bring such calls in too:
# - functions of libm whose last bit differs between glibc's variants (exactly rounded ones, such as
#   sqrt, floor and lround, are allowed);
# - the instruction cpuid: Eigen reads the sizes of caches with it, and they decide the order of
#   additions in its block products.
set -euo pipefail

names='a?(sin|cos|tan)h?|sincos|atan2|exp(2|10|m1)?|log(2|10|1p|b)?|pow|hypot|cbrt|erfc?|[lt]?gamma|fma|[jy][01n]'
refused=0

refuse() {
  [ -z "$2" ] && return
  echo "$2" >&2
  echo "error: $1" >&2
  refused=1
}

for library in "$@"; do
  calls=$(nm --undefined-only --print-file-name "$library" |
    grep -E " U (__)?($names)[fl]?(_finite|@.*)?$" || true)
  refuse "$(basename "$library"): call base/portable_math.hpp instead of libm" "$calls"
  asked=$(objdump --disassemble --no-show-raw-insn "$library" |
    awk '/>:$/ {at = $2} $NF == "cpuid" {print at}' | sort -u)
  refuse "$(basename "$library"): build it with slambed_fixed_eigen_blocks (cmake)" "$asked"
done
[ "$refused" = 0 ] || exit 1
echo "$# libraries hang on no processor"
