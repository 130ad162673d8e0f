#!/usr/bin/env bash
# Installs what building and rendering need and this machine misses: with apt on Debian and Ubuntu, elsewhere it says what
# to install. Quick and silent when nothing is missing.
#
#   scripts/setup.sh            what `make render` needs
#   scripts/setup.sh --python   and what the Python package needs
#   scripts/setup.sh --tests    and what the tests need; where the environment variable CI is set, an error if it cannot have all of it
set -euo pipefail
cd "$(dirname "$0")/.."

case "${1-}" in
    "" | --python) tests= ;;
    --tests) tests=$1 ;;
    *) echo "usage: scripts/setup.sh [--python|--tests]" >&2; exit 2 ;;
esac

# Rust does not come from the system's packages, which are often older than what Cargo.toml asks for.
wanted=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
found=$({ command -v cargo >/dev/null && rustc --version; } 2>/dev/null | cut -d' ' -f2) || found=
if [[ -z $found ]]; then
    echo "error: there is no Rust here" >&2
    echo "  cure: install Rust $wanted or newer as https://rustup.rs says, then run this again" >&2
    exit 1
elif [[ $(printf '%s\n' "$wanted" "${found%%-*}" | sort -V | head -n1) != "$wanted" ]]; then
    echo "error: Rust is $found, older than $wanted" >&2
    echo "  cure: rustup update stable" >&2
    exit 1
fi

# Without a pipe: grep ends at the first match, and ldconfig then fails at its next write.
library() { [[ $(PATH=$PATH:/sbin:/usr/sbin ldconfig -p 2>/dev/null) == *"$1"* ]]; }
# links COMPILER LANGUAGE HEADER
links() {
    local program
    program=$(mktemp)
    trap 'rm -f "$program"' RETURN
    printf '#include <%s>\nint main(void) { return 0; }\n' "$3" | "$1" -x "$2" -o "$program" - 2>/dev/null
}
# One file a driver in Mesa before 24, one for all since.
software_gl() { compgen -G '/usr/lib*/dri/swrast_dri.so' || compgen -G '/usr/lib*/*/dri/swrast_dri.so' ||
    compgen -G '/usr/lib*/libgallium-*.so' || compgen -G '/usr/lib*/*/libgallium-*.so'; } >/dev/null

# Daemons are where only root's PATH looks.
at_hand() { PATH=$PATH:/sbin:/usr/sbin command -v "$1" >/dev/null; }
packaged() { apt-cache show "$1" >/dev/null 2>&1; }
lists_there() { compgen -G '/var/lib/apt/lists/*Packages*' >/dev/null; }

# Names of what is missing in words, and as Debian, Fedora and Arch package it.
words=() debian=() fedora=() arch=()
missing() { words+=("$1"); debian+=($2); fedora+=($3); arch+=($4); }

links cc c stdlib.h || missing "a C compiler and linker (cc)" "gcc libc6-dev" gcc gcc
links c++ c++ vector || missing "a C++ compiler (c++)" g++ gcc-c++ gcc
command -v make >/dev/null || missing make make make make
library libEGL.so.1 || missing "libEGL.so.1 (GLVND)" libegl1 libglvnd-egl libglvnd
library libEGL_mesa.so.0 || missing "Mesa's EGL" libegl-mesa0 mesa-libEGL mesa
software_gl || missing "Mesa's software OpenGL driver" libgl1-mesa-dri mesa-dri-drivers mesa
if [[ ${1-} ]]; then
    python3 -c 'import ensurepip, venv' 2>/dev/null || missing "Python with venv" "python3 python3-venv" python3 python
fi
if [[ $tests ]]; then
    command -v glslangValidator >/dev/null || missing glslangValidator glslang-tools glslang glslang
    # Of the window: servers without a screen, who types and points, and what winit and glutin load by name.
    command -v Xvfb >/dev/null || missing Xvfb xvfb xorg-x11-server-Xvfb xorg-server-xvfb
    command -v xdotool >/dev/null || missing xdotool xdotool xdotool xdotool
    command -v weston >/dev/null || missing weston weston weston weston
    library libGL.so.1 || missing "libGL.so.1 (GLVND)" libgl1 libglvnd-glx libglvnd
    library libGLX_mesa.so.0 || missing "Mesa's GLX" libglx-mesa0 mesa-libGL mesa
    library libX11-xcb.so.1 || missing libX11-xcb libx11-xcb1 libX11-xcb libx11
    library libXcursor.so.1 || missing libXcursor libxcursor1 libXcursor libxcursor
    library libXi.so.6 || missing libXi libxi6 libXi libxi
    library libxkbcommon-x11.so.0 || missing libxkbcommon-x11 libxkbcommon-x11-0 libxkbcommon-x11 libxkbcommon-x11
    library libwayland-egl.so.1 || missing libwayland-egl libwayland-egl1 libwayland-egl wayland
    # Mesa 25.1 dropped OSMesa; where no package has it, tests of it are left out, and fail on CI.
    if command -v apt-get >/dev/null && ! library libOSMesa.so && { packaged libosmesa6 || ! lists_there; }; then
        missing libOSMesa libosmesa6 "" ""
    fi
    # Engines that tests/cluster.rs runs.
    if command -v apt-get >/dev/null; then
        at_hand munged || missing munge munge "" ""
        at_hand slurmctld && at_hand slurmd && at_hand srun || missing Slurm "slurmctld slurmd slurm-client" "" ""
        python3 -c 'import ensurepip, venv' 2>/dev/null || missing "Python's venv" python3-venv "" ""
        # For the validator of glTF.
        command -v npm >/dev/null || missing npm "nodejs npm" "" ""
    fi
fi

# Tests leave out what is not installed and say so. On CI they fail, and so does this script.
not_installed() {
    [[ ${CI-} ]] && { echo "error: not installed: $1" >&2; exit 1; }
    echo "warning: not installed: $1; tests that need this will say NOT TESTED" >&2
}
# Engines that are no system packages, in an environment of Python beside what Cargo builds.
python_packages() {
    local folder=${CARGO_TARGET_DIR:-target}/python packages=(openjd-cli==0.8.0 kubernetes-validate==1.37.0)
    [[ -x $folder/bin/openjd && -x $folder/bin/kubernetes-validate ]] && return
    echo "installing ${packages[*]}" >&2
    python3 -m venv "$folder" && "$folder/bin/pip" install --quiet --retries 1 "${packages[@]}" ||
        not_installed "${packages[*]}"
}
# Khronos' validator of glTF, beside it.
node_packages() {
    local folder=${CARGO_TARGET_DIR:-target}/node version=2.0.0-dev.3.10
    grep -qsF "\"version\": \"$version\"" "$folder/node_modules/gltf-validator/package.json" && return
    echo "installing gltf-validator $version" >&2
    npm install --prefix "$folder" --silent --no-audit --no-fund --no-save "gltf-validator@$version" >&2 ||
        not_installed "gltf-validator $version"
}
finish() {
    [[ $tests ]] || exit 0
    python_packages
    node_packages
    library libOSMesa.so || [[ -z ${CI-} ]] || not_installed libOSMesa
    exit 0
}

[[ ${#words[@]} -eq 0 ]] && finish

if command -v apt-get >/dev/null; then
    as_root=()
    if [[ $EUID -ne 0 ]]; then
        if ! command -v sudo >/dev/null; then
            echo "error: missing, and neither root nor sudo to install it: $(printf '%s; ' "${words[@]}")" >&2
            echo "  cure: as root, apt-get install ${debian[*]}" >&2
            exit 1
        fi
        as_root=(sudo)
    fi
    "${as_root[@]}" apt-get update -qq
    # Only the lists that have just come tell whether there still is one.
    packaged libosmesa6 || debian=("${debian[@]/libosmesa6/}")
    echo "installing" ${debian[*]} >&2
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends ${debian[@]} >/dev/null
    finish
fi

printf 'missing: %s\n' "${words[@]}" >&2
if command -v dnf >/dev/null; then
    echo "  cure: sudo dnf install ${fedora[*]}" >&2
elif command -v pacman >/dev/null; then
    echo "  cure: sudo pacman -S --needed ${arch[*]}" >&2
else
    echo "  cure: install these with the system's package manager (Debian calls them ${debian[*]})" >&2
fi
exit 1
