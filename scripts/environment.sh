#!/usr/bin/env bash
# Set up the environment that the project runs in. `make` calls this if something is missing.
#
#   scripts/environment.sh packages   install the Python packages of requirements.lock into .venv
#   scripts/environment.sh rendering  install a rendering library, if none is found
#   scripts/environment.sh page       fetch the libraries of the live page from the npm registry
#   scripts/environment.sh browser    install a browser and node for the page tests, if they are missing
#   scripts/environment.sh peers      install the packages of benchmarks/requirements.lock as well
#   scripts/environment.sh shared     install the packages of shared.lock as well
#   scripts/environment.sh stamp      print what .venv/.packages holds if all is installed
#   scripts/environment.sh lock       renew all locks from pyproject.toml
#   scripts/environment.sh lock-more  renew all but requirements.lock, beside what is in that
#
# Environment variables:
#   PYTHON        interpreter of version 3.11 or newer (default: the first found)
#   TORCH_INDEX   package index that torch comes from (empty: the default one)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

GL_PACKAGES=(libegl1 libegl-mesa0 libgl1-mesa-dri libopengl0)

stop() {
    echo "install: $*" >&2
    exit 1
}

# Run a command as root, if that needs no password.
as_root() {
    if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo -n "$@"; fi
}

# Install Debian or Ubuntu packages; fail if that is not permitted or does not work.
apt_install() {
    command -v apt-get >/dev/null || return 1
    if [ "$(id -u)" -eq 0 ]; then
        echo "install: apt-get install $*"
    else
        echo "install: sudo apt-get install $* (if sudo needs no password)"
        sudo -n true 2>/dev/null || return 1
    fi
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
    stop "Python 3.11 or newer is needed, and ${PYTHON:-python3} is older or missing." \
        "Install one, or name it: make install PYTHON=/path/to/python3.11"
}

# Install uv from the package index into .venv.
install_uv() {
    local python package
    if ! .venv/bin/python -m pip --version >/dev/null 2>&1; then
        python=$(find_python)
        # Debian and Ubuntu ship this part of Python's standard library in a separate package.
        if ! "$python" -c 'import ensurepip' 2>/dev/null; then
            package=$("$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')
            apt_install "$package" ||
                stop "Python's venv is missing; run: sudo apt-get install $package"
        fi
        "$python" -m venv --clear .venv
    fi
    .venv/bin/python -m pip install --quiet uv
}

# Have uv do without its cache where that cannot be written, as in a home that is read-only.
avoid_unwritable_cache() {
    local folder
    folder=$("$UV" cache dir)
    if ! mkdir -p "$folder" 2>/dev/null || [ ! -w "$folder" ]; then export UV_NO_CACHE=1; fi
}

# Set UV to the uv on the PATH, else to one in .venv.
find_uv() {
    UV=$(command -v uv || echo .venv/bin/uv)
    [ -x "$UV" ] || install_uv
    avoid_unwritable_cache
}

# Have uv use what pip is set to use, unless it has settings of its own.
take_over_settings_of_pip() {
    local python settings name value
    python=$(find_python)
    settings=$("$python" -m pip config list 2>/dev/null || true)
    setting() { # an environment variable counts more than pip's files
        name=$(echo "PIP_$1" | tr a-z- A-Z_)
        value=${!name-$(sed -n "s/^global\.$1='\(.*\)'$/\1/p" <<<"$settings")}
        [ -n "$value" ]
    }
    if setting index-url; then export UV_DEFAULT_INDEX=${UV_DEFAULT_INDEX-$value}; fi
    if setting cert; then export SSL_CERT_FILE=${SSL_CERT_FILE-$value}; fi
    if setting find-links; then export UV_FIND_LINKS=${UV_FIND_LINKS-${value// /,}}; fi
    if setting extra-index-url; then
        export UV_INDEX=${UV_INDEX-$value}
        export UV_INDEX_STRATEGY=${UV_INDEX_STRATEGY-unsafe-best-match} # as pip; hashes are checked
    fi
}

# Run `uv pip install` for .venv; what is installed is complete, so that nothing is resolved.
uv_install() {
    "$UV" pip install --python .venv/bin/python --no-deps "$@"
}

# Install torch from a local folder of wheels, or its own index: the usual one has the build for CUDA.
install_torch() {
    local requirement=$1
    if [ -n "${UV_FIND_LINKS-}" ] && uv_install --quiet --no-index "$requirement" 2>/dev/null; then
        return
    fi
    if [ -n "$TORCH_INDEX" ]; then
        UV_HTTP_TIMEOUT=${UV_HTTP_TIMEOUT-20} UV_HTTP_RETRIES=${UV_HTTP_RETRIES-1} \
            uv_install --default-index "$TORCH_INDEX" "$requirement" && return
        echo "install: no torch from $TORCH_INDEX, so the usual index's build is installed, on" \
            "Linux with CUDA: 6.7 GB in all instead of 2.8. TORCH_INDEX=URL names another index" >&2
    fi
    "$UV" pip install --python .venv/bin/python "$requirement" # with CUDA's own packages
}

# Have every Python of .venv find what belongs to it, where no `activate` was typed, too: its tools,
# as stages run by the name `python`, and a private folder for what DVC unpickles (by default in
# /var/tmp, where all users may write).
link_tools() {
    local folder
    folder=$(.venv/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
    mkdir -p -m 700 .venv/.dvc
    cat >"$folder/environment.pth" <<'END'
import os, sys; os.environ["PATH"] = f"{sys.prefix}/bin:{os.environ.get('PATH', os.defpath)}"
import os, sys; os.environ.setdefault("DVC_SITE_CACHE_DIR", f"{os.path.realpath(sys.prefix)}/.dvc")
END
}

# Print where .venv is, and its Python: its scripts name both, so that it works with no other.
stamp() {
    cd .venv 2>/dev/null && pwd -P && bin/python -V
}

install_packages() {
    [ ! -L .venv ] || stop ".venv belongs to $(readlink .venv). Run \`make install\` in that project," \
        "or \`rm .venv\` to have an environment here"
    # An environment that was moved, or has lost its Python, is made anew.
    [ ! -e .venv/.packages ] || [ "$(cat .venv/.packages)" = "$(stamp)" ] || rm -rf .venv
    find_uv
    take_over_settings_of_pip
    .venv/bin/python -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null ||
        "$UV" venv --quiet --clear --seed --python "$(find_python)" .venv
    echo "install: the packages of requirements.lock, into .venv: 2.8 GB, or 6.7 GB with CUDA, which" \
        "comes where TORCH_INDEX=$TORCH_INDEX cannot be reached"
    grep -v '^torch==' requirements.lock | uv_install --require-hashes -r - ||
        stop "not all packages could be installed, see above. If one had to be compiled, run:" \
            "sudo apt-get install gcc python3-dev. Python 3.11 to 3.13 need no compiler."
    install_torch "$(grep '^torch==' requirements.lock)"
    uv_install --quiet --no-build-isolation -e .
    link_tools
    stamp >.venv/.packages
}

can_render() {
    .venv/bin/python -c 'from jumping_ant.sim.gl import select_backend; select_backend()' 2>/dev/null
}

install_rendering() {
    if can_render || { apt_install "${GL_PACKAGES[@]}" && can_render; }; then
        touch .venv/.rendering
    else
        echo "install: nothing here renders without a screen, so no videos (all else works);" \
            "on Debian and Ubuntu run: sudo apt-get install ${GL_PACKAGES[*]}" >&2
    fi
}

install_page() {
    take_over_settings_of_pip # its certificates
    if .venv/bin/python -m jumping_ant.play.vendor; then
        touch .venv/.page
    else
        echo "install: the stage play will fail without these libraries (all else works)" >&2
    fi
}

install_browser() {
    local missing=()
    command -v chromium >/dev/null || missing+=(chromium)
    command -v node >/dev/null || missing+=(nodejs)
    if [ ${#missing[@]} -eq 0 ] || apt_install "${missing[@]}"; then
        touch .venv/.browser
    else
        echo "install: no ${missing[*]}, so tests of pages are skipped;" \
            "on Debian run: sudo apt-get install ${missing[*]}" >&2
    fi
}

# Install the packages of another lock, and mark that as done.
install_more() {
    find_uv
    take_over_settings_of_pip
    echo "install: the packages of $1, into .venv"
    # Without their requirements for packages that the project has: those stay as locked.
    uv_install --require-hashes -r "$1"
    touch ".venv/.$2"
}

# Print what an extra needs, with hashes, for every platform and Python that the project allows.
resolve() {
    local folder=$1 extra=$2
    shift 2
    "$UV" pip compile pyproject.toml --quiet --universal --python-version 3.11 \
        --upgrade --generate-hashes --fork-strategy fewest --no-annotate --no-header --extra "$extra" \
        --find-links "$folder/wheels" -c "$folder/torch.txt" --no-emit-package torch "$@"
}

# Download a torch without CUDA into a folder, to resolve against.
download_torch() {
    local python get
    python=$(find_python)
    get=("$python" -m pip download -qq --no-deps --python-version 3.11 --only-binary :all: --dest "$1"
        "$(grep -oE '"torch>[^"]*"' pyproject.toml | tr -d '"')")
    "${get[@]}" --no-index 2>/dev/null ||
        "${get[@]}" ${TORCH_INDEX:+--index-url "$TORCH_INDEX" --retries 2 --timeout 30} ||
        stop "no torch from ${TORCH_INDEX:-the usual package index}"
}

# Renew all locks; with "more", all but requirements.lock, whose versions the others then keep to.
renew_locks() {
    local folder version locked
    find_uv
    take_over_settings_of_pip
    folder=$(mktemp -d)
    trap 'rm -rf "'"$folder"'"' EXIT
    # Resolve against a build without CUDA, so that none of CUDA's packages is pulled in.
    download_torch "$folder/wheels"
    version=$(basename "$folder"/wheels/torch-*.whl | cut -d- -f2)
    echo "torch==$version" >"$folder/torch.txt"
    if [ "${1:-}" = more ]; then
        cp requirements.lock "$folder/requirements.lock"
    else
        {
            echo "# Every package at its exact version. Made by \`make lock\` from pyproject.toml."
            resolve "$folder" dev
            echo "# Without hashes: each of its indexes has builds of its own."
            echo "torch==${version%+*}"
        } >"$folder/requirements.lock"
    fi
    mapfile -t locked < <(sed -n 's/^\([^#=]*\)==.*/--no-emit-package=\1/p' "$folder/requirements.lock")
    {
        echo "# What \`make bench\` needs beyond requirements.lock. Made by \`make lock\`."
        resolve "$folder" bench "${locked[@]}"
    } >"$folder/peers.lock"
    grep -v '^torch==' "$folder/requirements.lock" >"$folder/locked.txt"
    {
        echo "# What \`make shared\` installs beyond requirements.lock. Made by \`make lock\`."
        resolve "$folder" shared -c "$folder/locked.txt" "${locked[@]}"
    } >"$folder/shared.lock"
    if grep -hE '^(nvidia|cuda|triton)' "$folder"/*.lock; then
        stop "these come with CUDA; renew the lock with a TORCH_INDEX without it"
    fi
    cp "$folder/requirements.lock" requirements.lock
    cp "$folder/peers.lock" benchmarks/requirements.lock
    cp "$folder/shared.lock" shared.lock
}

case "${1:-}" in
packages) install_packages ;;
rendering) install_rendering ;;
page) install_page ;;
browser) install_browser ;;
peers) install_more benchmarks/requirements.lock peers ;;
shared) install_more shared.lock shared ;;
stamp) stamp ;;
lock) renew_locks ;;
lock-more) renew_locks more ;;
*) stop "given '${1:-}', allowed: packages, rendering, page, browser, peers, shared, stamp, lock, lock-more" ;;
esac
