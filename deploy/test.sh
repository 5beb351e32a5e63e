#!/usr/bin/env bash
# Builds everything and runs the tests. The last line is "N passed, N failed" (and ", N skipped" if any were).
set -uo pipefail
cd "$(dirname "$0")/.." || exit 1

usage() {
  cat << 'USAGE'
usage: deploy/test.sh [--long] [--sanitizers]
  --long        also the tests that take minutes; prints the table of every reference case by every estimator, then takes the
                defences of tests/hard_cases out, one after the other: each that no test misses is a failure
  --sanitizers  build and run with AddressSanitizer and UndefinedBehaviorSanitizer instead
Needs Debian 12; installs what is missing, as root or with sudo. Ends with exit code 0 only if tests ran and all passed.
USAGE
}

preset=release
exclude=(--label-exclude '^long$')
for argument in "$@"; do
  case "$argument" in
    --long) exclude=() ;;
    --sanitizers)
      preset=asan
      export LSAN_OPTIONS="suppressions=$PWD/cmake/leaks.supp"
      ;;
    -h | --help)
      usage
      exit 0
      ;;
    *)
      echo "test.sh: unknown argument $argument" >&2
      usage >&2
      exit 2
      ;;
  esac
done

give_up() {
  echo "test.sh: $1" >&2
  echo "0 passed, 1 failed"
  exit 1
}

deploy/setup.sh || give_up "the set-up failed"
# Benchmarks are built so that they keep up with the code; none is run.
options=()
[ "$preset" = release ] && options=(-DWOODCOCK_BUILD_BENCH=ON)
cmake --preset "$preset" "${options[@]}" || give_up "the configuration failed"
jobs=$(nproc)
# A compiler process takes up to 1.5 GB.
by_memory=$(($(awk '/MemAvailable/ {print $2}' /proc/meminfo) / 1500000))
[ "$by_memory" -lt "$jobs" ] && jobs=$((by_memory > 0 ? by_memory : 1))
cmake --build "build/$preset" -j "$jobs" || give_up "the build failed"

# ctest takes properties by name: of two tests of one name each would get the labels and the time limit of the last.
twice=$(ctest --test-dir "build/$preset" -N | sed -n 's/^ *Test *#[0-9]*: //p' | sort | uniq -d)
[ -z "$twice" ] || give_up "more than one test is called: $twice"

report="build/$preset/test-report.xml"
rm -rf "$report" "build/$preset"/estimator-table*
ctest --test-dir "build/$preset" -j 2 --output-on-failure --output-junit test-report.xml "${exclude[@]}"
ctest_code=$?
[ -s "$report" ] || give_up "ctest wrote no report"

# Made by the long tests: every reference case by every estimator.
if [ "${#exclude[@]}" -eq 0 ] && [ -d "build/$preset/estimator-table" ]; then
  cat "build/$preset"/estimator-table/*.md > "build/$preset/estimator-table.md"
  echo "== build/$preset/estimator-table.md"
  cat "build/$preset/estimator-table.md"
fi

# Each defence is taken out in a copy below build/mutants; of the sanitizers' build it would say nothing else.
undefended=0
if [ "${#exclude[@]}" -eq 0 ] && [ "$preset" = release ]; then
  for list in hard_cases faults; do
    tests/hard_cases/run_mutants.py --list "tests/$list/mutants.txt" --jobs "$jobs" | tee "build/$preset/mutants-$list.txt"
    if [ "${PIPESTATUS[0]}" -ne 0 ]; then
      found=$(grep -c -E '^(survived|stale|broken) ' "build/$preset/mutants-$list.txt")
      [ "$found" -gt 0 ] || found=1
      undefended=$((undefended + found))
    fi
  done
fi

count() { grep -o -m 1 "$1=\"[0-9]*\"" "$report" | head -n 1 | tr -dc '0-9'; }
total=$(count tests)
failed=$(($(count failures) + undefended))
skipped=$(($(count skipped) + $(count disabled)))
passed=$((total - $(count failures) - skipped))
code=0
if [ "$ctest_code" -ne 0 ] || [ "$failed" -ne 0 ] || [ "$passed" -le 0 ]; then code=1; fi
if [ "$code" -ne 0 ] && [ "$failed" -eq 0 ]; then failed=1; fi
line="$passed passed, $failed failed"
[ "$skipped" -gt 0 ] && line="$line, $skipped skipped"
echo "$line"
exit "$code"
