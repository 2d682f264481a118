#!/usr/bin/env bash
# Builds and runs programs against packages that apt has installed: nobody says where anything is. usage: check_apt.sh
# SCRATCH_DIR
set -euo pipefail
scratch=$1
sources=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
rm -rf "$scratch"
mkdir -p "$scratch"
unset LD_LIBRARY_PATH PKG_CONFIG_PATH CMAKE_PREFIX_PATH PYTHONPATH
say() { printf '%-34s' "$1"; }

say "apt install, C++:"
# shellcheck disable=SC2046  # flags are words
c++ -std=c++20 "$sources/examples/minimal.cpp" -o "$scratch/minimal" $(pkg-config --cflags --libs halfshade)
"$scratch/minimal" | grep -c . >/dev/null && echo ok
say "apt install, C:"
# shellcheck disable=SC2046
cc -std=c99 "$sources/examples/c_minimal.c" -o "$scratch/c_minimal" $(pkg-config --cflags --libs halfshade)
"$scratch/c_minimal" | grep -c '@@@@@@@@' >/dev/null && echo ok
say "apt install, CMake:"
cmake -S "$sources/tests/api/consumer" -B "$scratch/cmake" -G Ninja >/dev/null
cmake --build "$scratch/cmake" -- --quiet
"$scratch/cmake/consumer"
say "apt install, Python:"
PYTHONDONTWRITEBYTECODE=1 /usr/bin/python3 "$sources/examples/python/soft_shadows.py" "$scratch/python.png" | tail -1
say "apt install, command line:"
halfshade --version
