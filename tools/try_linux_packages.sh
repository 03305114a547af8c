#!/usr/bin/env bash
# Tries the Linux packages in dist/ as a person would who has no Python: in a bare Debian or Ubuntu, as an ordinary user.
#
#   sudo tools/try_linux_packages.sh [--fresh] [--suite SUITE] [--tar] [DIR]
#
#   DIR        where the bare systems are made and kept (default /tmp/nep-packages)
#   --suite    which Debian, or Ubuntu's jammy or noble (default bookworm)
#   --tar      unpack the .tar.xz in the user's home instead of installing the .deb
#   --fresh    throw the system away and make it again
#
# The package is installed, its self-test is run, the menu entry and the file type are looked for, and it is removed.
# Then nothing may be left but what is the user's.
set -euo pipefail
. "$(dirname "$0")/bare_system.sh"

fresh=no suite=bookworm kind=deb dir=/tmp/nep-packages
while [ $# -gt 0 ]; do
    case $1 in
        --fresh) fresh=yes ;;
        --suite) suite=$2; shift ;;
        --tar) kind=tar ;;
        -*) sed -n '2,13s/^# \{0,1\}//p' "$0"; exit 2 ;;
        *) dir=$1 ;;
    esac
    shift
done
check_programs

repository=$(cd "$(dirname "$0")/.." && pwd)
system=$dir/$suite-$kind user=ana home="/home/Ana María 太郎"
[ $fresh = no ] || rm -rf --one-file-system "$system"
make_system "$system" "$suite" ca-certificates
rm -rf "$system/packages" && mkdir "$system/packages"
cp "$repository"/dist/*.deb "$repository"/dist/*.tar.xz "$system/packages/"
root() { enter "$system" root /root / sh -ec "$1"; }
ana() { enter "$system" $user "$home" "$home" sh -ec "$1"; }

root "id $user >/dev/null 2>&1 || useradd --create-home --home-dir '$home' $user
      apt-get update -qq; apt-get install -y -qq --no-install-recommends xvfb xauth xz-utils >/dev/null"
! root "command -v python3" || { echo "there is a Python in this system: the try would prove nothing" >&2; exit 1; }
root "find / -xdev \( -path /proc -o -path /tmp -o -path /var -o -path /packages \) -prune -o -print | sort >/before"

if [ $kind = deb ]; then
    # An earlier try may have ended before its end.
    root "apt-get purge -y -qq nep-studio >/dev/null 2>&1 || true; apt-get autoremove -y -qq --purge >/dev/null"
    root "DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends /packages/nep-studio_*.deb >/dev/null
          dpkg-query -W -f '\${Package} \${Version} \${Installed-Size} kB\n' nep-studio"
    program=nep-studio command=/opt/nep-studio/nep
else
    # What every desktop has and a bare system has not; the .deb asks for it by name.
    root "DEBIAN_FRONTEND=noninteractive apt-get satisfy -y -qq --no-install-recommends \
          \"\$(dpkg-deb -f /packages/nep-studio_*.deb Depends)\" >/dev/null"
    ana "tar -xf /packages/NEP-Studio-*.tar.xz && ./NEP-Studio-*/install.sh --command"
    program="./NEP-Studio-*/nep-studio" command="./.local/bin/nep"
fi

ana "rm -rf out; xvfb-run -a -s '-screen 0 1600x1000x24' $program --selftest out || { cat out/report.json; exit 1; }
     grep -E '\"(ok|why|frozen|first_paint_ms|editor_ready_ms|total_ms)\"' out/report.json | sort | uniq -c"
ana "$command --version && $program --version"
mkdir -p "$dir/results-$suite-$kind" && cp "$system$home"/out/* "$dir/results-$suite-$kind/" 2>/dev/null || true

if [ $kind = deb ]; then
    root "apt-get purge -y -qq nep-studio >/dev/null; apt-get autoremove -y -qq --purge >/dev/null"
else
    ana "./NEP-Studio-*/install.sh --remove && rm -rf ./NEP-Studio-* out"
fi
root "find / -xdev \( -path /proc -o -path /tmp -o -path /var -o -path /packages \) -prune -o -print | sort >/after
      echo 'left of the system: '; comm -13 /before /after | grep -v '^/before\|^/after\|^/home/' | grep -i nep || echo '  nothing'
      echo 'left in the home:'; comm -13 /before /after | grep '^/home/' | cut -d/ -f1-5 | sort -u"
