# shellcheck shell=bash disable=SC2034  # The variables are for the scripts that source this.
# Sourced by the other scripts; needs bash. The one list of Debian packages is here.

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
jobs=$(nproc)

# What the command line needs, and what the tests and benchmarks need on top.
packages_build=(cmake g++ ninja-build pkg-config libeigen3-dev libopencv-dev libflann-dev
                libnanoflann-dev libceres-dev libyaml-cpp-dev nlohmann-json3-dev libcli11-dev
                libkainjow-mustache-dev libjs-chart.js)
packages_test=("${packages_build[@]}" ccache clang libgtest-dev libbenchmark-dev doxygen
               python3-onnx python3-pytest python3-mypy python3-opencv python3-matplotlib
               python3-dev python3-venv python3-pip python3-build python3-setuptools python3-wheel
               python3-numpy pybind11-dev)
# What one test each needs, and skips without. Debian has them, not every Ubuntu does.
packages_optional=(chromium colmap python3-open3d)

# Prints which of the given Debian packages are not installed.
missing_packages() {
  local package
  for package in "$@"; do
    dpkg-query -W -f '${db:Status-Status}\n' "$package" 2>/dev/null | grep -qx installed ||
      echo "$package"
  done
}

# Installs the given Debian packages that are missing; calls apt only if there are some.
install_packages() {
  if ! command -v dpkg-query >/dev/null; then
    echo "Not a Debian or Ubuntu machine: please see to these yourself: $*" >&2
    return
  fi
  local missing sudo=()
  mapfile -t missing < <(missing_packages "$@")
  if ((${#missing[@]} == 0)); then
    return
  fi
  echo "Installing ${missing[*]}" >&2
  if ((EUID != 0)); then
    if ! command -v sudo >/dev/null; then
      echo "Not root, and no sudo: as root run 'apt-get install ${missing[*]}', then try again" >&2
      return 1
    fi
    sudo=(sudo)
  fi
  local apt=("${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq -o Acquire::Retries=3)
  "${apt[@]}" update >&2
  "${apt[@]}" install -y --no-install-recommends "${missing[@]}" >&2
}

# Arguments for cmake: ninja and ccache where they are.
configure_arguments() {
  if command -v ninja >/dev/null; then
    echo -G Ninja
  fi
  if command -v ccache >/dev/null; then
    echo -DCMAKE_CXX_COMPILER_LAUNCHER=ccache
  fi
}

# Builds the command line in the folder $1, with all that it needs; its path is then in stillpoint.
build_command_line() {
  local build=$1 extra
  install_packages "${packages_build[@]}"
  read -ra extra <<<"$(configure_arguments | tr '\n' ' ')"
  mkdir -p "$build"
  echo "Building the command line in $build" >&2
  if ! {
    cmake -S "$root" -B "$build" "${extra[@]}" -DCMAKE_BUILD_TYPE=Release \
      -DSTILLPOINT_BUILD_TESTS=OFF -DSTILLPOINT_BUILD_BENCHMARKS=OFF &&
      cmake --build "$build" --parallel "$jobs" --target stillpoint_cli
  } >"$build/log.txt" 2>&1; then
    tail -n 40 "$build/log.txt" >&2
    echo "The build failed; all of its output: $build/log.txt" >&2
    exit 1
  fi
  stillpoint=$(find "$build/examples" -type f -name stillpoint -perm -u+x | head -n 1)
}

# Runs a command of the command line that fills the folder $1, unless the same program and options
# have filled it already: they make the same files again.
make_once() { # FOLDER COMMAND...
  local folder=$1 made
  shift
  made="$* $(cksum <"$stillpoint")"
  if [[ $(cat "$folder/made_by.txt" 2>/dev/null) != "$made" ]]; then
    mkdir -p "$(dirname "$folder")"
    "$stillpoint" "$@"
    echo "$made" >"$folder/made_by.txt"
  fi
}

# Renders a sequence into the folder $1 by the options of `stillpoint synth` after it, and adds the
# folder to sequences.
render() {
  sequences+=("$1")
  make_once "$1" synth "$@"
}

# The same with an exposure, by a name that tells `stillpoint bench` that sequences differ in nothing
# else.
render_blurred() { # FOLDER MOTION FRAMES MS
  render "$(printf '%s/%s_%02dms' "$1" "$2" "$4")" --motion "$2" --frames "$3" --shutter-ms "$4"
}

# Lets ccache keep objects that use a precompiled header, and find those of another folder of the
# project: the test of `pip install .` compiles what the build has compiled.
export CCACHE_SLOPPINESS=${CCACHE_SLOPPINESS:-pch_defines,time_macros}
export CCACHE_BASEDIR=${CCACHE_BASEDIR:-$root}
