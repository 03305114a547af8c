#!/usr/bin/env bash
# Tests the Linux packages in dist/ in a minimal Debian or Ubuntu without Python, as an ordinary user.
#
#   sudo tools/try_linux_packages.sh [--fresh] [--suite SUITE] [--tar] [DIR]
#
#   DIR        folder of the systems, which are kept (default /tmp/nep-packages)
#   --suite    a release of Debian, or Ubuntu's jammy or noble (default bookworm)
#   --tar      unpack the .tar.xz in the user's home instead of installing the .deb
#   --fresh    delete the system and create it again
#
# Installs the package, runs its self-test, removes it, and lists the files that are left. Only the user's own files
# may be left.
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
! root "command -v python3" || { echo "this system has a Python; the test needs one without" >&2; exit 1; }
root "find / -xdev \( -path /proc -o -path /tmp -o -path /var -o -path /packages \) -prune -o -print | sort >/before"

if [ $kind = deb ]; then
    # An earlier run may have been interrupted.
    root "apt-get purge -y -qq nep-studio >/dev/null 2>&1 || true; apt-get autoremove -y -qq --purge >/dev/null"
    root "DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends /packages/nep-studio_*.deb >/dev/null
          dpkg-query -W -f '\${Package} \${Version} \${Installed-Size} kB\n' nep-studio"
    program=nep-studio command=/opt/nep-studio/nep
else
    # Libraries of every desktop that a minimal system lacks; the .deb declares them as dependencies.
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
      echo 'left in the system:'; comm -13 /before /after | grep -v '^/before\|^/after\|^/home/' | grep -i nep || echo '  nothing'
      echo 'left in the home folder:'; comm -13 /before /after | grep '^/home/' | cut -d/ -f1-5 | sort -u"
