#!/bin/sh
# Adds NEP Studio to the menu of the current user and associates .nepb files with it. Needs no administrator rights.
#   ./install.sh             add menu entry, file type and icons
#   ./install.sh --command   also add the command nep to ~/.local/bin
#   ./install.sh --remove    remove all of them; your files are kept
set -eu
here=$(cd "$(dirname "$0")" && pwd)
data=${XDG_DATA_HOME:-$HOME/.local/share}
command=$HOME/.local/bin/nep
menu=$data/applications/nep-studio.desktop
types=$data/mime/packages/nep-studio.xml

refresh() {
    if command -v update-desktop-database >/dev/null; then update-desktop-database -q "$data/applications" || true; fi
    if command -v update-mime-database >/dev/null; then update-mime-database "$data/mime" >/dev/null 2>&1 || true; fi
    if command -v gtk-update-icon-cache >/dev/null; then gtk-update-icon-cache -qft "$data/icons/hicolor" || true; fi
}

icons() { (cd "$here/share/icons" && find hicolor -type f); }

remove() {
    rm -f "$menu" "$types"
    icons | while read -r icon; do rm -f "$data/icons/$icon"; done
    if [ "$(readlink "$command" 2>/dev/null || true)" = "$here/nep" ]; then rm -f "$command"; fi
    refresh
}

if [ "${1:-}" = --remove ]; then
    remove
    echo "NEP Studio is no longer in your menu. Delete the folder $here to remove the program; your files are kept."
    exit 0
fi
mkdir -p "$data/applications" "$data/mime/packages"
# Quoting rules of the desktop entry specification: \ " ` $ are escaped with a backslash, and % is doubled.
quoted=$(printf '%s' "$here/nep-studio" | sed -e 's/[\\"`$]/\\&/g' -e 's/%/%%/g' -e 's/\\/\\\\/g')
escaped=$(printf '%s' "$quoted" | sed -e 's/[\\&|]/\\&/g')
sed -e "s|^Exec=nep-studio|Exec=\"$escaped\"|" "$here/share/applications/nep-studio.desktop" >"$menu"
cp "$here/share/mime/packages/nep-studio.xml" "$types"
icons | while read -r icon; do
    mkdir -p "$data/icons/$(dirname "$icon")"
    cp "$here/share/icons/$icon" "$data/icons/$icon"
done
refresh
echo "NEP Studio is now in your menu and opens .nepb files."
if [ "${1:-}" = --command ]; then
    mkdir -p "$(dirname "$command")"
    ln -sfn "$here/nep" "$command"
    echo "The command nep was added to $(dirname "$command")."
fi
