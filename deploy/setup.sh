#!/usr/bin/env bash
# Installs what Woodcock needs on Debian 12. Idempotent: does nothing, and needs no rights, when all is there.
set -euo pipefail

case "${1:-}" in
  "") ;;
  -h | --help)
    echo "usage: deploy/setup.sh"
    echo "Installs the missing Debian 12 packages, as root or with sudo. Safe to run again."
    exit 0
    ;;
  *)
    echo "setup.sh takes no arguments, found: $1" >&2
    exit 2
    ;;
esac

packages=(
  # build
  g++ make git cmake ninja-build ccache pkg-config
  # ray casting, images, vectors, threads, volumes
  libembree-dev libopenimageio-dev openimageio-tools libglm-dev libtbb-dev libopenvdb-dev libnanovdb-dev
  zlib1g-dev libblosc-dev libboost-iostreams-dev
  # remote procedure calls, database, digests
  libgrpc++-dev protobuf-compiler-grpc libprotobuf-dev protobuf-compiler libsoci-dev libsqlite3-dev libssl-dev
  # command line, logs, formats, plots
  libcli11-dev libspdlog-dev libfmt-dev nlohmann-json3-dev gnuplot-nox
  # tests, benchmarks
  libgtest-dev libgmock-dev librapidcheck-dev libbenchmark-dev libtinyexr-dev python3 python3-grpcio python3-protobuf
)

command -v dpkg-query > /dev/null || {
  echo "setup.sh: this is no Debian system; install these yourself: ${packages[*]}" >&2
  exit 1
}

missing=()
for package in "${packages[@]}"; do
  state=$(dpkg-query -W -f '${db:Status-Status}' "$package" 2> /dev/null || true)
  [ "$state" = installed ] || missing+=("$package")
done
if [ ${#missing[@]} -eq 0 ]; then
  echo "setup: all ${#packages[@]} packages are installed"
  exit 0
fi

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo > /dev/null || {
    echo "setup.sh: run me as root, or install sudo; missing packages: ${missing[*]}" >&2
    exit 1
  }
  as_root=(sudo)
fi
apt_get() { "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=300 "$@"; }

echo "setup: installing ${missing[*]}"
apt_get update -qq
apt_get install -y -qq --no-install-recommends "${missing[@]}"
echo "setup: done"
