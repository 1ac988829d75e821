# Functions that the scripts share; source it from bash. Leaves the shell in the top folder.

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
venv=$root/.venv
python=$venv/bin/python
cd "$root"

# Open MPI: allow root in a container and more ranks than cores. Other MPI libraries ignore these.
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
export OMPI_MCA_rmaps_base_oversubscribe=${OMPI_MCA_rmaps_base_oversubscribe:-1}
export OMPI_MCA_hwloc_base_binding_policy=${OMPI_MCA_hwloc_base_binding_policy:-none}
export OMPI_MCA_mpi_yield_when_idle=${OMPI_MCA_mpi_yield_when_idle:-1}
export OMPI_MCA_btl_vader_single_copy_mechanism=${OMPI_MCA_btl_vader_single_copy_mechanism:-none}
# One thread a rank: the ranks are the parallelism.
export OPENBLAS_NUM_THREADS=1

build_packages=(gfortran openmpi-bin libopenmpi-dev libhdf5-openmpi-dev liblapack-dev
  libopenblas-dev libfftw3-dev cmake ninja-build pkg-config)
# What .venv gets from Debian where pip reaches no index.
python_packages=(python3-pip python3-setuptools python3-wheel python3-numpy python3-h5py
  python3-xarray python3-h5netcdf python3-matplotlib python3-pytest)
# What .venv gets beside the packages that postproc asks for.
python_tools=('pytest>=7' 'ruff>=0.6' 'fortitude-lint==0.10.*')

say() { printf '== %s\n' "$*"; }

die() {
  printf '%s: %s\n' "$(basename "$0")" "$*" >&2
  exit 1
}

# install_packages NAME...: install the missing ones of these Debian packages.
install_packages() {
  local missing=() name
  for name in "$@"; do
    [[ $(dpkg-query -W -f='${db:Status-Status}' "$name" 2>/dev/null) == installed ]] || missing+=("$name")
  done
  [[ ${#missing[@]} -gt 0 ]] || return 0

  local sudo=()
  if [[ $(id -u) -ne 0 ]]; then
    sudo -n true 2>/dev/null || die "needs these packages; install them and run it again:
  sudo apt-get install ${missing[*]}"
    sudo=(sudo -n)
  fi
  say "installing ${missing[*]}"
  "${sudo[@]}" apt-get update -q || say 'apt-get update failed; going on with the lists there are'
  "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive \
    apt-get install -q -y --no-install-recommends "${missing[@]}" ||
    die "could not install ${missing[*]}"
}

# Compiler, libraries and CMake.
need_build_tools() {
  local tool missing=()
  if command -v apt-get >/dev/null; then
    install_packages "${build_packages[@]}"
  else
    for tool in gfortran mpirun cmake ninja pkg-config; do
      command -v "$tool" >/dev/null || missing+=("$tool")
    done
    [[ ${#missing[@]} -eq 0 ]] || die "cannot find ${missing[*]}; please install gfortran, Open MPI, \
HDF5 with MPI and Fortran, LAPACK, FFTW 3, CMake 3.25 or newer, Ninja and pkg-config"
  fi
}

# The Python of tests and figures, in .venv; made again when what it should hold changes.
need_python() {
  local wanted stamp=$venv/spurflex-stamp
  wanted=$(cksum postproc/pyproject.toml scripts/common.sh)
  if [[ -f $stamp && $(<"$stamp") == "$wanted" ]] && "$python" -c 'import spurflex_postproc' 2>/dev/null; then
    return
  fi
  say 'making .venv'
  rm -rf "$venv"
  make_venv python3 ||
    { command -v apt-get >/dev/null && install_packages python3-venv && make_venv /usr/bin/python3; } ||
    die 'cannot make a Python environment: needs Python 3.11 or newer with its venv module'
  if ! "$python" -m pip install -q --disable-pip-version-check --retries 2 \
    -e postproc "${python_tools[@]}"; then
    say 'pip did not get its packages; taking those of Debian, without the linters (rm -r .venv to try anew)'
    command -v apt-get >/dev/null || die "please make pip reach its index, or install ${python_packages[*]}"
    install_packages python3-venv "${python_packages[@]}"
    rm -rf "$venv"
    make_venv /usr/bin/python3 --system-site-packages || die 'cannot make a Python environment'
    "$python" -m pip install -q --disable-pip-version-check --no-index --no-deps --no-build-isolation \
      -e postproc
  fi
  "$python" -c 'import h5netcdf, h5py, matplotlib, numpy, pytest, xarray, spurflex_postproc' ||
    die 'the Python environment in .venv is not complete'
  printf '%s\n' "$wanted" >"$stamp"
}

# make_venv PYTHON [OPTION...]: an empty .venv, if that Python is new enough and has venv and pip.
make_venv() {
  "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null &&
    "$1" -m venv "${@:2}" "$venv" >/dev/null 2>&1 || { rm -rf "$venv" && false; }
}

# build PRESET [TARGET]: configure and compile, everything without a target; leaves the program in
# the build folder of the preset.
build() {
  local options=()
  # Debian's commands are those of the default MPI library, HDF5 above is Open MPI's.
  if [[ -x /usr/bin/mpirun.mpich && -x /usr/bin/mpirun.openmpi ]]; then
    options+=(-D MPI_Fortran_COMPILER=/usr/bin/mpifort.openmpi
      -D MPIEXEC_EXECUTABLE=/usr/bin/mpirun.openmpi
      -D HDF5_Fortran_COMPILER_EXECUTABLE=/usr/bin/h5pfc.openmpi)
  fi
  [[ ! -x $python ]] || options+=(-D SPURFLEX_PYTHON="$python")
  say "building: $1"
  # Status lines go away, warnings and errors stay.
  cmake --preset "$1" --log-level=NOTICE "${options[@]}" >/dev/null
  cmake --build --preset "$1" ${2:+--target "$2"}
}

# mpirun of the library that the release build is linked with.
mpirun_of_build() {
  sed -n 's/^MPIEXEC_EXECUTABLE:[A-Z]*=//p' "$root/build/CMakeCache.txt"
}
