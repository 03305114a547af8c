#!/usr/bin/env bash
# Tests the README's two commands from a fresh clone in a minimal Debian 12 with only python3 and git.
#
#   sudo tools/try_bare_debian.sh [--fresh] [--user] [DIR] [-- COMMAND ...]
#
#   DIR        folder of the system, which is kept (default /tmp/nep-bare; 400 MB, with packages 1.5 GB)
#   --fresh    delete the system in DIR and create it again
#   --user     run as an ordinary user (the system packages must be installed already)
#   COMMAND    run this command instead, for example  -- python3 dev.py demo
set -euo pipefail
. "$(dirname "$0")/bare_system.sh"

fresh=no user=root dir=/tmp/nep-bare
while [ $# -gt 0 ]; do
    case $1 in
        --fresh) fresh=yes ;;
        --user) user=nobody ;;
        --) shift; break ;;
        -*) sed -n '2,9s/^# \{0,1\}//p' "$0"; exit 2 ;;
        *) dir=$1 ;;
    esac
    shift
done
check_programs git

repository=$(cd "$(dirname "$0")/.." && pwd)
system=$dir/system clone=/home/clone home=/root
[ $fresh = no ] || rm -rf --one-file-system "$system"
make_system "$system" bookworm python3,git,ca-certificates

say "cloning $(git -C "$repository" rev-parse --short HEAD)"
rm -rf --one-file-system "$system$clone"
git clone --quiet --no-hardlinks "file://$repository" "$system$clone"
[ $user = root ] || { chown -R nobody "$system$clone"; home=$clone; }

if [ $# -gt 0 ]; then
    enter "$system" $user $home $clone "$@"
else
    enter "$system" $user $home $clone python3 dev.py demo
    enter "$system" $user $home $clone python3 dev.py test
fi
