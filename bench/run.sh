#!/usr/bin/env bash
# Builds and runs everything in bench/ and prints ratios, each taken within one run: rays and look-ups per second against bare loops, what
# the effect plan gains, and the efficiency of the estimators against each other.
set -euo pipefail
cd "$(dirname "$0")/.."

usage() {
  cat << 'USAGE'
usage: bench/run.sh [--seconds S] [SCENE...]
  --seconds S   CPU time for each estimator a round, of 8 rounds (default 1: about half an hour in all)
  SCENE...      further scenes for the table of efficiencies, beside cloud, milk, fire and fog
Wants a quiet machine. Prints Markdown.
USAGE
}

seconds=1
scenes=()
while [ $# -gt 0 ]; do
  case "$1" in
    --seconds)
      [ $# -gt 1 ] || { usage >&2; exit 2; }
      seconds=$2
      shift
      ;;
    -h | --help) usage; exit 0 ;;
    -*) usage >&2; exit 2 ;;
    *) scenes+=("$(realpath "$1")") ;;
  esac
  shift
done

# Release, whatever the other build folders hold; the compiler's output is wanted only where it fails.
log=$(mktemp)
trap 'rm -f "$log"' EXIT
{
  cmake --preset release -DWOODCOCK_BUILD_BENCH=ON &&
    cmake --build build/release --target surface_bench media_bench kernels many_lights efficiency
} > "$log" 2>&1 || { cat "$log" >&2; exit 1; }
programs=build/release/bench

echo "## Surfaces: rays per second of the path loop against bare Embree on the same rays"
echo
"$programs/surface_bench"

echo
echo "## Media: look-ups per second of free flights against a bare loop over the same points"
echo
"$programs/media_bench" --benchmark_filter='FreeFlight|LookUpsOneByOne' --benchmark_repetitions=5 --benchmark_enable_random_interleaving=true \
  --benchmark_report_aggregates_only=true --benchmark_format=csv 2> "$log" |
  awk -F, '/_median/ {
      gsub(/"/, "", $1); sub(/_median/, "", $1)
      split($1, name, "/"); rate[name[1], name[2]] = $7
    }
    END {
      split("sparse:0 sparse:1", kinds, " ")
      for (i = 1; i <= 2; ++i) {
        bare = rate["LookUpsOfFreeFlight", kinds[i]]
        printf "%s: %.1f of %.1f million a second, ratio %.2f; of the bare loop with each look-up awaited (%.1f) %.2f; sixteen flights in step %.1f\n",
               i == 1 ? "dense grid" : "sparse grid", rate["FreeFlight", kinds[i]] / 1e6, bare / 1e6, rate["FreeFlight", kinds[i]] / bare,
               rate["LookUpsOneByOne", kinds[i]] / 1e6, rate["FreeFlight", kinds[i]] / rate["LookUpsOneByOne", kinds[i]],
               rate["FreeFlightsInStep", kinds[i]] / 1e6
      }
    }' || { cat "$log" >&2; exit 1; }

echo
echo "## Many lights: choice by what arrives against choice by power"
echo
"$programs/many_lights" --seconds "$seconds"

echo
echo "## The effect plan"
echo
"$programs/kernels" --seconds "$seconds"

echo
echo "## Efficiency of the estimators"
"$programs/efficiency" --seconds "$seconds"
[ ${#scenes[@]} -eq 0 ] || "$programs/efficiency" --seconds "$seconds" "${scenes[@]}"
