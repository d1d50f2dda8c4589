#!/bin/sh
# Compile a board's top from the command line and print Fmax and use. Needs Quartus Prime (Lite is enough) on PATH.
# compile.sh: rtds_top, with converters. compile.sh rtds_hps: rtds_top_hps, driven by the board's own processor.
# The build identity (register BUILD) is the first 28 bits of the commit. Ends with status 1 when timing is not met or a
# constraint matched nothing.
set -eu
cd "$(dirname "$0")"
project=${1:-rtds}
if [ ! -f "$project.qsf" ]; then
    echo "$project: no such project (known: rtds, rtds_hps)" >&2
    exit 2
fi
if ! command -v quartus_sh >/dev/null 2>&1; then
    echo "quartus_sh is not on PATH: install Quartus Prime Lite with Cyclone V support" >&2
    exit 2
fi
build=$(git rev-parse HEAD 2>/dev/null | cut -c 1-8 || true)
out=../build/quartus
mkdir -p "$out"
quartus_sh -t compile.tcl "${build:-00000000}" "$project"
met=0
quartus_sta -t report.tcl "$project" >"$out/timing.txt" 2>&1 || met=$?
cat "$out/timing.txt"
sed -n '/Logic utilization/p;/Total registers/p;/Total DSP/p;/Total block memory/p;/Total PLLs/p' "$out/$project.fit.summary"
# Quartus warns of these and goes on: 332174 a filter that matched nothing, 332049 a constraint left out for that,
# 332060 a clock that nothing constrains.
if grep -E '\((332174|332049|332060)\)' "$out/timing.txt" >&2; then
    echo "a constraint matched nothing, or a clock has none (above)" >&2
    exit 1
fi
if [ "$met" -ne 0 ]; then
    echo "timing is not met (above), or was not reported: status $met" >&2
    exit 1
fi
