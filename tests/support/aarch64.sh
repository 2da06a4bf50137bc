#!/usr/bin/env bash
# Runs Python 3.11 for aarch64 by qemu-user, with the arguments given: for wheels of that processor where there is none.
#   aarch64.sh ARGUMENT ...            its exit status is that of Python; 125 when that cannot be had here
# Packages qemu-user-static and, for arm64, python3.11 and libstdc++6 of Debian, unpacked below AARCH64_HOME (no root needed).
set -eu
home=${AARCH64_HOME:-$HOME/.cache/gantryctl-aarch64}
if [ ! -x "$home/root/usr/bin/python3.11" ] || [ ! -x "$home/usr/bin/qemu-aarch64-static" ]; then
  command -v apt-get >/dev/null && command -v dpkg >/dev/null || { echo "aarch64.sh: no apt-get here" >&2; exit 125; }
  mkdir -p "$home/host" "$home/state/lists/partial" "$home/cache/archives/partial" "$home/root"
  # Lists and packages of the other processor stay out of this computer's own.
  own=(-qq -o "Dir::State=$home/state" -o Dir::State::status=/dev/null -o "Dir::Cache=$home/cache" -o APT::Architecture=arm64
       -o APT::Architectures=arm64 -o "APT::Sandbox::User=$(id -un)")
  (cd "$home/host" && apt-get download -qq qemu-user-static >/dev/null) &&
    apt-get "${own[@]}" update >/dev/null &&
    apt-get "${own[@]}" install -y --no-install-recommends --download-only python3.11 libpython3.11-stdlib libstdc++6 >/dev/null ||
    { echo "aarch64.sh: cannot download Debian's packages" >&2; exit 125; }
  for package in "$home"/host/*.deb; do dpkg -x "$package" "$home"; done
  for package in "$home"/cache/archives/*.deb; do dpkg -x "$package" "$home/root"; done
fi
exec "$home/usr/bin/qemu-aarch64-static" -L "$home/root" "$home/root/usr/bin/python3.11" "$@"
