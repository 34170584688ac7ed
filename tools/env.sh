# SPDX-License-Identifier: BSD-3-Clause
#
# Put a bash or zsh into the environment of this workspace:
#
#     . tools/env.sh
#
# Works from any directory, and again after a rebuild. Leaves the options of the shell as they are.

_grid_map_py_enter() {
    local root=$1 shell=$2 flags=$- code=0 assignments
    set +e +u # The set-up files of colcon read unset variables and let commands fail.
    if assignments=$("$root/tools/workspace" exports); then
        eval "$assignments"
        [ -e "$root/install/local_setup.$shell" ] && . "$root/install/local_setup.$shell"
    else
        code=1
    fi
    case $flags in *u*) set -u ;; esac
    case $flags in *e*) set -e ;; esac
    return $code
}

if [ -n "${ZSH_VERSION-}" ]; then
    eval 'set -- "${${(%):-%x}:A:h:h}" zsh "$@"' # bash could not even parse this
else
    set -- "$(CDPATH='' cd -- "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)" bash "$@"
fi
_grid_map_py_enter "$1" "$2" || { shift 2; unset -f _grid_map_py_enter; return 1; }
shift 2
unset -f _grid_map_py_enter
