#!/usr/bin/env bash
# Builds and runs programs of somebody else against an installed tree: in C++ and C, with CMake and with pkg-config,
# shared and static, and in Python. usage: check_installed.sh PREFIX SCRATCH_DIR
set -euo pipefail
prefix=$(cd "$1" && pwd)
scratch=$2
sources=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
rm -rf "$scratch"
mkdir -p "$scratch"

find_one() { find "$prefix" -path "*/$1" | grep . | head -1; }
libdir=$(dirname "$(find_one 'libhalfshade.so')")
export PKG_CONFIG_PATH=$libdir/pkgconfig
say() { printf '%-34s' "$1"; }

cmake_consumer() { # project, program, options...
  local project=$1 program=$2 dir
  shift 2
  dir=$(mktemp -d "$scratch/cmake-XXXX")
  cmake -S "$sources/tests/api/$project" -B "$dir" -G Ninja -DCMAKE_PREFIX_PATH="$prefix" "$@" >/dev/null
  cmake --build "$dir" -- --quiet
  "$dir/$program"
}

# C++ without a build system; the compiler gets the flags that pkg-config says.
flags_of() { pkg-config "$@" halfshade; }

say "CMake, C++, shared:"
cmake_consumer consumer consumer -DHALFSHADE_KIND=shared
say "CMake, C++, static:"
cmake_consumer consumer consumer -DHALFSHADE_KIND=static
say "CMake, C only:"
cmake_consumer consumer_c consumer_c | grep -c '@@@@@@@@' >/dev/null && echo ok

say "pkg-config, C++, shared:"
# shellcheck disable=SC2046  # flags are words
c++ -std=c++20 "$sources/tests/api/consumer/main.cpp" -o "$scratch/cxx" $(flags_of --cflags --libs)
LD_LIBRARY_PATH=$libdir "$scratch/cxx"
say "pkg-config, C, shared:"
# shellcheck disable=SC2046
cc -std=c99 -pedantic -Werror "$sources/examples/c_minimal.c" -o "$scratch/c" $(flags_of --cflags --libs)
LD_LIBRARY_PATH=$libdir "$scratch/c" | grep -c '@@@@@@@@' >/dev/null && echo ok

# The linker prefers a shared library of the same name, so the archive is given in its place.
say "pkg-config --static, C:"
static_libs=$(flags_of --static --libs | sed "s|-lhalfshade|$libdir/libhalfshade.a|g")
# shellcheck disable=SC2046,SC2086
cc -std=c99 "$sources/examples/c_minimal.c" -o "$scratch/c_static" $(flags_of --cflags) $static_libs
"$scratch/c_static" | grep -c '@@@@@@@@' >/dev/null && echo ok
if readelf -d "$scratch/c_static" | grep -q libhalfshade; then
  echo "c_static needs the shared library" >&2
  exit 1
fi

python_dir=$(find "$prefix" -path '*-packages/halfshade/__init__.py' | head -1)
if [[ -n $python_dir ]]; then
  say "Python:"
  LD_LIBRARY_PATH=$libdir PYTHONDONTWRITEBYTECODE=1 PYTHONPATH=$(dirname "$(dirname "$python_dir")") \
    /usr/bin/python3 "$sources/examples/python/soft_shadows.py" "$scratch/python.png" | tail -1
fi

manual=$(find "$prefix" -name 'halfshade.1.gz' | head -1)
if [[ -n $manual ]]; then
  say "command line:"
  LD_LIBRARY_PATH=$libdir "$prefix/bin/halfshade" --version
fi
