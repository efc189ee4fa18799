# Functions that find or install Python, system packages and uv, and read the package index from pip's configuration.
# Source it with the repository's root as the working folder:  . scripts/machine.sh
# shellcheck shell=sh

unset VIRTUAL_ENV PYTHONHOME PYTHONPATH

UV_PINNED=0.13.8

say() { printf '%s\n' "autodrive: $*" >&2; }
fail() { say "$*"; exit 1; }

# Runs a command that may say nothing for a long time:  slowly TEXT FOLDER COMMAND ...
root=$PWD
slowly() { "${python:-$(find_python)}" "$root/scripts/progress" "$@"; }

# -- Python 3.11 to 3.14 -----------------------------------------------------------------------------------------

fits() { "$1" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 15))' >/dev/null 2>&1; }

find_python() {
    for name in ${AUTODRIVE_PYTHON:-} python3 python3.14 python3.13 python3.12 python3.11 /usr/bin/python3; do
        if fits "$name"; then
            "$name" -c 'import sys; print(sys.executable)'
            return
        fi
    done
}

# -- apt, only for missing packages ------------------------------------------------------------------------------

apt_install() {
    as_root=
    if [ "$(id -u)" -ne 0 ]; then as_root="sudo "; fi
    line="${as_root}apt-get install -y --no-install-recommends $*"
    if ! command -v apt-get >/dev/null 2>&1; then
        fail "$* is missing and apt-get was not found. $without_apt"
    fi
    if [ -n "$as_root" ] && ! command -v sudo >/dev/null 2>&1; then
        fail "$* is missing. Installing it needs root or sudo. An administrator can run:  apt-get install -y $*"
    fi
    say "installing a system package:  $line"
    # The existing package list may be sufficient, so a failed update is not an error.
    # shellcheck disable=SC2086
    slowly "reading the lists of packages" "" ${as_root}env DEBIAN_FRONTEND=noninteractive apt-get update -q || say "apt-get update failed; continuing"
    # shellcheck disable=SC2086
    slowly "installing system packages" "" ${as_root}env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "$@" ||
        fail "could not install $*; apt-get prints the reason above. Then run:  $line"
}

# -- uv: from PATH, or installed into .venv-uv -------------------------------------------------------------------

# Whether $1 is uv 0.9 or newer; older versions may not read uv.lock.
is_recent() { "$1" --version 2>/dev/null | awk '{ split($2, v, "."); exit !(v[1] > 0 || v[2] >= 9) }'; }

find_uv() {
    for uv in uv .venv-uv/bin/uv; do
        if "$uv" --version >/dev/null 2>&1 && is_recent "$uv"; then return; fi
    done
    if ! "$python" -c 'import ensurepip, venv' >/dev/null 2>&1; then
        without_apt="Install uv (https://docs.astral.sh/uv), then run this script again."
        apt_install "$("$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')"
    fi
    say "installing uv $UV_PINNED from PyPI into .venv-uv (17 MB)"
    rm -rf .venv-uv
    slowly "making .venv-uv" .venv-uv "$python" -m venv .venv-uv
    slowly "installing uv" .venv-uv .venv-uv/bin/python -m pip install --disable-pip-version-check --only-binary :all: "uv==$UV_PINNED" ||
        fail "could not install uv from PyPI. Check the network and the configuration of pip:  .venv-uv/bin/pip config list"
    uv=.venv-uv/bin/uv
}

# -- configuration of pip ----------------------------------------------------------------------------------------

pip_setting() { "$python" - "$1" <<'PYTHON'
import configparser, os, pathlib, sys

name = sys.argv[1]
files = ["/etc/pip.conf", "~/.pip/pip.conf", "~/.config/pip/pip.conf", os.environ.get("PIP_CONFIG_FILE", "")]
settings = configparser.RawConfigParser(strict=False)
settings.read([pathlib.Path(file).expanduser() for file in files if file])
value = os.environ.get("PIP_" + name.upper().replace("-", "_"))
for section in ("install", "global"):
    value = value or settings.get(section, name, fallback=None)
print(value or "")
PYTHON
}

# -- everything together -----------------------------------------------------------------------------------------

# Sets $python, $uv, $certificates and $index (empty: PyPI), and the environment variables of uv.
find_tools() {
    python=$(find_python)
    [ -n "$python" ] || fail "Python 3.11 to 3.14 is needed but was not found on PATH. On Debian 12 or newer:  apt-get install python3 python3-venv"
    find_uv
    export UV_PYTHON="$python" UV_HTTP_TIMEOUT="${UV_HTTP_TIMEOUT:-180}"
    certificates=$(pip_setting cert)
    if [ -z "${SSL_CERT_FILE:-}" ] && [ -f "$certificates" ]; then export SSL_CERT_FILE="$certificates"; fi
    index=${UV_DEFAULT_INDEX:-${UV_INDEX_URL:-$(pip_setting index-url)}}
    case "$index" in
    https://pypi.org/simple | https://pypi.org/simple/) index= ;;
    esac
    if [ -n "$index" ]; then export UV_DEFAULT_INDEX="$index"; fi
}
