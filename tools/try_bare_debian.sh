#!/usr/bin/env bash
# Tries the two commands in a bare Debian 12, in which there is nothing but python3 and git, from a fresh clone.
#
#   sudo tools/try_bare_debian.sh [--fresh] [--user] [DIR] [-- COMMAND ...]
#
#   DIR        where the bare system is made and kept (default /tmp/nep-bare, some 400 MB; with packages 1.5 GB)
#   --fresh    throw the system in DIR away and make it again
#   --user     run as an ordinary user (after the packages are there)
#   COMMAND    instead of both: such as  -- python3 dev.py demo
#
# Needs root, debootstrap and unshare. apt and pip use this computer's own configuration of mirrors, proxies and
# certificates. Every mount lives in a name space of its own and is gone when the script ends.
set -euo pipefail

fresh=no user=root dir=/tmp/nep-bare
while [ $# -gt 0 ]; do
    case $1 in
        --fresh) fresh=yes ;;
        --user) user=nobody ;;
        --) shift; break ;;
        -*) sed -n '2,14s/^# \{0,1\}//p' "$0"; exit 2 ;;
        *) dir=$1 ;;
    esac
    shift
done
[ "$(id -u)" = 0 ] || { echo "only root can make a system in a folder; try: sudo $0" >&2; exit 2; }
for program in debootstrap unshare git; do
    command -v "$program" >/dev/null || { echo "'$program' is missing; try: apt-get install $program" >&2; exit 2; }
done

repository=$(cd "$(dirname "$0")/.." && pwd)
system=$dir/system
begin=$SECONDS
say() { printf '== %4d s  %s\n' $((SECONDS - begin)) "$*"; }

[ $fresh = no ] || rm -rf --one-file-system "$system"
if [ ! -e "$system/made" ]; then
    say "making a bare Debian 12 in $system"
    mkdir -p "$dir"
    rm -rf --one-file-system "$system"
    debootstrap --variant=minbase --include=python3,git,ca-certificates bookworm "$system" >"$dir/debootstrap.log" 2>&1 ||
        { tail "$dir/debootstrap.log" >&2; exit 1; }
    # No package lists: a person's new computer has none, or old ones.
    rm -rf "$system"/var/lib/apt/lists/* "$system"/var/cache/apt/archives/*.deb
    cp -r /etc/apt/apt.conf.d/. "$system/etc/apt/apt.conf.d/"
    # Hooks of the packages of this computer mean nothing over there.
    grep -lE 'Post-Invoke' "$system"/etc/apt/apt.conf.d/* | xargs -r rm
    if ls /etc/apt/sources.list.d/debian.sources >/dev/null 2>&1; then
        cp /etc/apt/sources.list.d/debian.sources "$system/etc/apt/sources.list.d/"
        rm -f "$system/etc/apt/sources.list"
    fi
    for file in /etc/pip.conf /etc/ssl/certs/ca-certificates.crt; do
        [ ! -e "$file" ] || cp "$file" "$system$file"
    done
    touch "$system/made"
fi
cp -L /etc/resolv.conf "$system/etc/resolv.conf"
cp -L /etc/hosts "$system/etc/hosts"

say "cloning $(git -C "$repository" rev-parse --short HEAD)"
rm -rf --one-file-system "$system/home/clone"
clone=/home/clone
git clone --quiet --no-hardlinks "file://$repository" "$system$clone"
[ $user = root ] || chown -R nobody "$system$clone"

# Only what a package manager needs to reach its servers comes in from this computer's environment.
variables=(HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8)
[ $user = root ] || variables[0]=HOME=$clone
while IFS= read -r -d '' variable; do
    case $variable in
        PIP_CERT=* | PIP_INDEX_URL=* | PIP_DEFAULT_TIMEOUT=* | PIP_PROXY=*) variables+=("$variable") ;;
        [Hh][Tt][Tt][Pp]_[Pp][Rr]*=* | [Hh][Tt][Tt][Pp][Ss]_[Pp]*=* | [Nn][Oo]_[Pp][Rr]*=*) variables+=("$variable") ;;
    esac
done < <(env -0)

inside='
set -euo pipefail
system=$1; user=$2; clone=$3; shift 3
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
enter() { # COMMAND ... in the clone
    say "as $user: $*"
    local code=0
    unshare --mount --pid --fork --kill-child bash -c "$inside" inside "$system" "$user" "$clone" \
        "${variables[@]}" sh -c 'cd "$0" && exec "$@"' "$clone" "$@" </dev/null || code=$?
    say "exit code $code"
    return $code
}

if [ $# -gt 0 ]; then
    enter "$@"
else
    enter python3 dev.py demo
    enter python3 dev.py test
fi
