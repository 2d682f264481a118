#!/usr/bin/env bash
# fuzz_for_long.sh TARGET SECONDS: ./dev fuzz, or exit code 77 and a message where there is no libFuzzer.
set -euo pipefail
program=$(mktemp)
trap 'rm -f "$program"' EXIT
if ! echo 'extern "C" int LLVMFuzzerTestOneInput(const unsigned char*, unsigned long) { return 0; }' |
  clang++ -fsanitize=fuzzer -x c++ - -o "$program" 2>/dev/null; then
  echo "skipped: clang++ with libFuzzer is not installed (Debian: clang, libclang-rt-14-dev)"
  exit 77
fi
exec "$(dirname "${BASH_SOURCE[0]}")/../../dev" fuzz "$1" --seconds "$2"
