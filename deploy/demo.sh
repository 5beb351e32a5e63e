#!/usr/bin/env bash
# Builds Woodcock, starts a coordinator and two workers here, renders the example cloud on them and fetches the image.
set -euo pipefail

case "${1:-}" in
  "") ;;
  -h | --help)
    echo "usage: deploy/demo.sh"
    echo "Renders scenes/cloud.pbrt with a coordinator and two workers into ./woodcock-demo (numbered if it exists)."
    echo "WOODCOCK_DEMO_SPP sets the samples per pixel (default 256)."
    exit 0
    ;;
  *)
    echo "demo.sh takes no arguments, found: $1" >&2
    exit 2
    ;;
esac

here=$PWD
root=$(cd "$(dirname "$0")/.." && pwd)
samples=${WOODCOCK_DEMO_SPP:-256}

out=$here/woodcock-demo
number=2
until mkdir "$out" 2> /dev/null; do
  [ -e "$out" ] || {
    echo "demo.sh: cannot make a folder in $here" >&2
    exit 1
  }
  out=$here/woodcock-demo-$number
  number=$((number + 1))
done

service=
stop() {
  if [ -n "$service" ] && kill -TERM "$service" 2> /dev/null; then wait "$service" || true; fi
  service=
}
trap stop EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

"$root/deploy/setup.sh"
echo "demo: building (the log is $out/build.log)"
jobs=$(nproc)
by_memory=$(($(awk '/MemAvailable/ {print $2}' /proc/meminfo) / 1500000))
[ "$by_memory" -lt "$jobs" ] && jobs=$((by_memory > 0 ? by_memory : 1))
if ! (cd "$root" && cmake --preset release && cmake --build build/release -j "$jobs" \
  --target woodcock woodcock-worker woodcock-coordinator) > "$out/build.log" 2>&1; then
  tail -n 30 "$out/build.log" >&2
  echo "demo.sh: the build failed" >&2
  exit 1
fi

bin=$root/build/release/bin
"$bin/woodcock" up --workers 2 --dir "$out/service" --port 0 --json > "$out/service.json" 2> "$out/service.log" &
service=$!
for _ in $(seq 600); do
  [ -s "$out/service.json" ] && break
  kill -0 "$service" 2> /dev/null || {
    cat "$out/service.log" >&2
    exit 1
  }
  sleep 0.1
done
address=$(sed -n 's/.*"address":"\([^"]*\)".*/\1/p' "$out/service.json")
[ -n "$address" ] || {
  echo "demo.sh: the service did not start within a minute; see $out/service/logs" >&2
  exit 1
}
echo "demo: a coordinator at $address and two workers"

begin=$(date +%s)
"$bin/woodcock" submit "$root/scenes/cloud.pbrt" --coordinator "$address" --spp "$samples" -o "$out/cloud.exr"
echo "demo: $samples samples per pixel took $(($(date +%s) - begin)) s"
stop
echo "demo: image $out/cloud.exr, to look at: $out/cloud.png"
