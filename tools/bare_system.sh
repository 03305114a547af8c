# Functions that create a minimal Debian or Ubuntu in a folder and run commands in it; sourced by the try_*.sh scripts.
# Needs root, debootstrap and unshare. apt and pip use this computer's configuration of mirrors, proxies and
# certificates. Mounts are made in a separate mount namespace, which ends with the command.

begin=$SECONDS
say() { printf '== %4d s  %s\n' $((SECONDS - begin)) "$*"; }

check_programs() {
    [ "$(id -u)" = 0 ] || { echo "must be run as root; try: sudo $0" >&2; exit 2; }
    local program
    for program in debootstrap unshare "$@"; do
        command -v "$program" >/dev/null || { echo "'$program' is missing; try: apt-get install $program" >&2; exit 2; }
    done
}

UBUNTU_SUITES=" jammy noble " UBUNTU=http://archive.ubuntu.com/ubuntu
UBUNTU_SCRIPT=/usr/share/debootstrap/scripts/gutsy # used for all later releases; Debian's debootstrap lacks the newest ones

make_system() { # FOLDER SUITE PACKAGES: create a newly installed system
    local system=$1 suite=$2 packages=$3 from=()
    if [[ $UBUNTU_SUITES = *" $suite "* ]]; then
        from=(--components=main,universe)
        # Without the key (package ubuntu-keyring), signatures can't be verified.
        [ -e /usr/share/keyrings/ubuntu-archive-keyring.gpg ] || from+=(--no-check-gpg)
    fi
    if [ ! -e "$system/complete" ]; then
        say "creating a minimal $suite in $system"
        mkdir -p "$(dirname "$system")"
        rm -rf --one-file-system "$system"
        debootstrap --variant=minbase --include="$packages" ${from[@]+"${from[@]}"} "$suite" "$system" \
            ${from:+"$UBUNTU" "$UBUNTU_SCRIPT"} >"$system.log" 2>&1 || { tail "$system.log" >&2; exit 1; }
        # No package lists: those of a newly installed computer are missing or outdated.
        rm -rf "$system"/var/lib/apt/lists/* "$system"/var/cache/apt/archives/*.deb
        cp -r /etc/apt/apt.conf.d/. "$system/etc/apt/apt.conf.d/"
        # Hooks refer to programs of this computer.
        grep -lE 'Post-Invoke' "$system"/etc/apt/apt.conf.d/* | xargs -r rm
        if [[ $UBUNTU_SUITES = *" $suite "* ]]; then
            printf 'deb %s %s main universe\n' "$UBUNTU" "$suite" "$UBUNTU" "$suite-updates" \
                >"$system/etc/apt/sources.list"
        elif ls /etc/apt/sources.list.d/debian.sources >/dev/null 2>&1; then
            sed "s/bookworm/$suite/g" /etc/apt/sources.list.d/debian.sources \
                >"$system/etc/apt/sources.list.d/debian.sources"
            rm -f "$system/etc/apt/sources.list"
        fi
        local file
        for file in /etc/pip.conf /etc/ssl/certs/ca-certificates.crt; do
            [ ! -e "$file" ] || { mkdir -p "$system$(dirname "$file")" && cp "$file" "$system$file"; }
        done
        touch "$system/complete"
    fi
    cp -L /etc/resolv.conf "$system/etc/resolv.conf"
    cp -L /etc/hosts "$system/etc/hosts"
}

inside='
set -euo pipefail
system=$1; user=$2; shift 2
mount -t proc proc "$system/proc"
mount -t tmpfs tmpfs "$system/dev"
for node in null:1:3 zero:1:5 full:1:7 random:1:8 urandom:1:9 tty:5:0; do
    IFS=: read -r name major minor <<<"$node"
    mknod -m 666 "$system/dev/$name" c "$major" "$minor"
done
mkdir "$system/dev/shm" "$system/dev/pts"
mount -t tmpfs -o mode=1777 tmpfs "$system/dev/shm"
mount -t devpts -o newinstance,ptmxmode=666 devpts "$system/dev/pts"
ln -s pts/ptmx "$system/dev/ptmx"; ln -s /proc/self/fd "$system/dev/fd"
exec chroot --userspec="$user" "$system" /usr/bin/env -i "$@"
'

enter() { # SYSTEM USER HOME FOLDER COMMAND ...: run a command in the system; return its exit code
    local system=$1 user=$2 home=$3 folder=$4 code=0 variable
    shift 4
    # Pass on only the variables that package managers need to reach their servers.
    local variables=(HOME="$home" PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8)
    while IFS= read -r -d '' variable; do
        case $variable in
            PIP_CERT=* | PIP_INDEX_URL=* | PIP_DEFAULT_TIMEOUT=* | PIP_PROXY=*) variables+=("$variable") ;;
            [Hh][Tt][Tt][Pp]_[Pp][Rr]*=* | [Hh][Tt][Tt][Pp][Ss]_[Pp]*=* | [Nn][Oo]_[Pp][Rr]*=*)
                variables+=("$variable") ;;
        esac
    done < <(env -0)
    say "as $user: $*"
    unshare --mount --pid --fork --kill-child bash -c "$inside" inside "$system" "$user" \
        "${variables[@]}" sh -c 'cd "$0" && exec "$@"' "$folder" "$@" </dev/null || code=$?
    say "exit code $code"
    return $code
}
