#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-2-Clause
# pkg_config.sh PREFIX LIBDIR WORK: builds and runs the consumer programs with the flags of pkg-config for the installed copy.
set -euo pipefail
prefix=$1 libdir=$2 work=$3
source_dir=$(cd "$(dirname "$0")" && pwd)/project

export PKG_CONFIG_PATH="$prefix/$libdir/pkgconfig"
mkdir -p "$work"

build_and_run() { # PROGRAM PACKAGE
  local -a flags
  read -r -a flags <<<"$("$PKG_CONFIG" --cflags --libs "$2")"
  "$CXX" -std=c++17 "$source_dir/$1.cpp" -o "$work/$1" "${flags[@]}" "-Wl,-rpath,$prefix/$libdir"
  "$work/$1"
}

"$PKG_CONFIG" --print-errors --exists pmsp
build_and_run consumer pmsp
if "$PKG_CONFIG" --exists pmsp_io; then
  build_and_run consumer_io pmsp_io
fi
