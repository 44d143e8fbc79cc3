#!/usr/bin/env bash
# Make the environment that the project runs in. `make` calls this where something is missing.
#
#   scripts/environment.sh packages   install the Python packages of requirements.lock into .venv
#   scripts/environment.sh rendering  install a library to draw with, where none is found
#   scripts/environment.sh browser    install a browser for the tests of pages, where none is found
#   scripts/environment.sh peers      install those of benchmarks/requirements.lock as well
#   scripts/environment.sh lock       renew both locks from pyproject.toml
#
# Environment variables:
#   PYTHON        interpreter of version 3.11 or newer (default: the first found)
#   TORCH_INDEX   package index that torch comes from (empty: the usual one)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

GL_PACKAGES=(libegl1 libegl-mesa0 libgl1-mesa-dri libopengl0)

stop() {
    echo "install: $*" >&2
    exit 1
}

# Run a command as root, where that takes no password.
as_root() {
    if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo -n "$@"; fi
}

# Install Debian or Ubuntu packages; false where that is not permitted or does not work.
apt_install() {
    command -v apt-get >/dev/null && as_root true 2>/dev/null || return 1
    echo "install: apt-get install $*"
    as_root apt-get update -qq &&
        as_root env DEBIAN_FRONTEND=noninteractive \
            apt-get install -qq --no-install-recommends "$@" >/dev/null
}

find_python() {
    local candidate
    for candidate in ${PYTHON:-python3 python3.13 python3.12 python3.11}; do
        if "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
            echo "$candidate"
            return
        fi
    done
    stop "Python 3.11 or newer is needed, and ${PYTHON:-python3} is not." \
        "Install one, or name it: make install PYTHON=/path/to/python3.11"
}

# Make a virtual environment in a folder, in place of what is there.
make_venv() {
    local python package
    python=$(find_python)
    # Debian and Ubuntu keep this part of Python's own library in a package of its own.
    if ! "$python" -c 'import ensurepip' 2>/dev/null; then
        package=$("$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')
        apt_install "$package" ||
            stop "Python's venv is missing; run: sudo apt-get install $package"
    fi
    "$python" -m venv --clear "$1"
}

# Install torch as one requirement says, from its own index alone: the usual index has the build
# with CUDA, of several gigabytes.
install_torch() {
    local python=$1 requirement=$2
    shift 2
    "$python" -m pip install "$@" "$requirement" \
        ${TORCH_INDEX:+--index-url "$TORCH_INDEX" --retries 2 --timeout 30} ||
        stop "no torch from ${TORCH_INDEX:-the usual package index}. Try again, or take the usual" \
            "index's build, on Linux with CUDA: make install TORCH_INDEX="
}

install_packages() {
    local python=.venv/bin/python
    "$python" -m pip --version >/dev/null 2>&1 || make_venv .venv
    echo "install: the packages of requirements.lock, into .venv"
    # The lock is complete: nothing is resolved here, so that nothing can bring CUDA along.
    grep -v '^torch==' requirements.lock | "$python" -m pip install --no-deps -r /dev/stdin
    install_torch "$python" "$(grep '^torch==' requirements.lock)"
    # Last the project, and whatever this platform needs beyond the one the lock was made on.
    "$python" -m pip install --quiet --no-build-isolation -c requirements.lock -e '.[dev]'
    touch .venv/.packages
}

can_render() {
    .venv/bin/python -c 'from jumping_ant.sim.gl import select_backend; select_backend()' 2>/dev/null
}

install_rendering() {
    if can_render || { apt_install "${GL_PACKAGES[@]}" && can_render; }; then
        touch .venv/.rendering
    else
        echo "install: nothing here draws without a screen, so no videos (all else works);" \
            "on Debian and Ubuntu run: sudo apt-get install ${GL_PACKAGES[*]}" >&2
    fi
}

install_browser() {
    if command -v chromium >/dev/null || apt_install chromium; then
        touch .venv/.browser
    else
        echo "install: no chromium, so the tests of pages will fail;" \
            "on Debian run: sudo apt-get install chromium" >&2
    fi
}

install_peers() {
    echo "install: the packages of benchmarks/requirements.lock, into .venv"
    # Without their wishes for other versions of what the project has: those stay as locked.
    .venv/bin/python -m pip install --no-deps -r benchmarks/requirements.lock
    touch .venv/.peers
}

# Print what a Python has, without the suffix of torch's build (+cpu), which the usual index does
# not know.
freeze() {
    "$1" -m pip freeze --all --exclude pip --exclude-editable | sed 's/+.*//'
}

renew_locks() {
    local folder python
    folder=$(mktemp -d)
    trap 'rm -rf "'"$folder"'"' EXIT
    python=$folder/bin/python
    make_venv "$folder"
    # Torch first, which keeps the others from bringing the usual index's build.
    install_torch "$python" "$(grep -oE '"torch[^"]*"' pyproject.toml | tr -d '"')" -qq
    "$python" -m pip freeze | grep '^torch==' >"$folder/torch.txt"
    "$python" -m pip install -qq --upgrade --upgrade-strategy eager -c "$folder/torch.txt" \
        -e '.[dev]'
    {
        echo "# Every package at its exact version. Made by \`make lock\` from pyproject.toml."
        freeze "$python"
    } >"$folder/requirements.lock"
    "$python" -m pip install -qq -c "$folder/torch.txt" -e '.[bench]'
    sed -n 's/^\([^#=]*\)==.*/^\1==/p' "$folder/requirements.lock" >"$folder/locked.txt"
    {
        echo "# What \`make bench\` needs beyond requirements.lock. Made by \`make lock\`."
        freeze "$python" | grep -vif "$folder/locked.txt"
    } >"$folder/peers.lock"
    if grep -hE '^(nvidia|cuda|triton)' "$folder/requirements.lock" "$folder/peers.lock"; then
        stop "these come with CUDA; renew the lock with a TORCH_INDEX without it"
    fi
    cp "$folder/requirements.lock" requirements.lock
    cp "$folder/peers.lock" benchmarks/requirements.lock
}

case "${1:-}" in
packages) install_packages ;;
rendering) install_rendering ;;
browser) install_browser ;;
peers) install_peers ;;
lock) renew_locks ;;
*) stop "given '${1:-}', allowed: packages, rendering, browser, peers, lock" ;;
esac
