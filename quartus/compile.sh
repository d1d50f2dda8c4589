#!/bin/sh
# Compile the board's top from the command line and print Fmax and use. Needs Quartus Prime (Lite is enough) on PATH.
# The build identity (register BUILD) is the first 32 bits of the commit.
set -eu
cd "$(dirname "$0")"
if ! command -v quartus_sh >/dev/null 2>&1; then
    echo "quartus_sh is not on PATH: install Quartus Prime Lite with Cyclone V support" >&2
    exit 2
fi
build=$(git rev-parse HEAD 2>/dev/null | cut -c 1-8 || true)
quartus_sh -t compile.tcl "${build:-00000000}"
quartus_sta -t report.tcl
sed -n '/Logic utilization/p;/Total registers/p;/Total DSP/p;/Total block memory/p;/Total PLLs/p' ../build/quartus/rtds.fit.summary
