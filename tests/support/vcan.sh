#!/usr/bin/env bash
# Runs a command on a kernel that has CAN: user-mode Linux, booted in seconds on the files of this computer, with vcan0 up.
#   vcan.sh COMMAND [ARGUMENT ...]     its exit status is that of COMMAND; 125 when there is no such kernel here
# Packages user-mode-linux, kmod, can-utils, iproute2: those of the system, or unpacked below VCAN_HOME (no root needed).
# One processor and no promises of time: judge order and content there, not milliseconds.
set -eu
home=${VCAN_HOME:-$HOME/.cache/gantryctl-vcan}
seconds=${VCAN_S:-300}

# Debian's packages, unpacked where they are not installed.
needed=()
[ -x /usr/bin/linux.uml ] || [ -x "$home/usr/bin/linux.uml" ] || needed+=(user-mode-linux)
command -v kmod >/dev/null || [ -x "$home/bin/kmod" ] || [ -x "$home/usr/bin/kmod" ] || needed+=(kmod)
command -v candump >/dev/null || [ -x "$home/usr/bin/candump" ] || needed+=(can-utils)
if [ "${#needed[@]}" -gt 0 ]; then
  command -v apt-get >/dev/null && command -v dpkg >/dev/null || { echo "vcan.sh: no ${needed[*]}, and no apt-get" >&2; exit 125; }
  mkdir -p "$home/packages"
  (cd "$home/packages" && apt-get download -qq "${needed[@]}" >/dev/null) || { echo "vcan.sh: cannot download ${needed[*]}" >&2; exit 125; }
  for package in "$home"/packages/*.deb; do dpkg -x "$package" "$home"; done
fi
export PATH="$PATH:/usr/sbin:/sbin:$home/usr/bin:$home/bin"
kernel=$(command -v linux.uml)
modules=$(ls -d /usr/lib/uml/modules/*/kernel "$home"/usr/lib/uml/modules/*/kernel 2>/dev/null | head -1)
[ -n "$modules" ] || { echo "vcan.sh: no modules of the kernel" >&2; exit 125; }

run=$(mktemp -d)
trap 'rm -rf "$run"' EXIT
ln -s "$(command -v kmod)" "$run/insmod"
export -p >"$run/environment"
printf '%q ' "$@" >"$run/command"
# The driver's own echo (echo=1), as controllers have it: a frame comes back when it has passed the queue, so that
# netem acts on it. Without it the kernel hands a copy to its own sockets before the queue.
cat >"$run/init" <<EOF
#!/bin/bash
. "$run/environment"
mount -t proc proc /proc
mount -t sysfs sys /sys
mkdir -p /dev/shm
mount -t tmpfs tmpfs /dev/shm
mount -t tmpfs tmpfs /run
for module in net/can/can net/can/can-raw drivers/net/can/dev/can-dev net/sched/sch_netem; do
  "$run/insmod" "$modules/\$module.ko"
done
"$run/insmod" "$modules/drivers/net/can/vcan.ko" echo=1
ip link set lo up
ip link add dev vcan0 type vcan
ip link set vcan0 up
cd $(printf %q "$PWD")
. "$run/command" >"$run/output" 2>&1 </dev/null
echo \$? >"$run/status"
sync
echo o >/proc/sysrq-trigger
sleep 5
EOF
chmod +x "$run/init"
# On a processor with AMX that kernel dies of its first process (wide_xstate.c says why).
wide=()
if grep -qw amx_tile /proc/cpuinfo; then
  ${CC:-cc} -O2 -shared -fPIC -o "$run/wide_xstate.so" "$(dirname "$0")/wide_xstate.c" -ldl || { echo "vcan.sh: no C compiler" >&2; exit 125; }
  wide=(env "LD_PRELOAD=$run/wide_xstate.so")
fi
timeout "$seconds" ${wide[@]+"${wide[@]}"} "$kernel" mem=1G rootfstype=hostfs rootflags=/ rw "init=$run/init" con=null con0=null,fd:1 quiet \
  </dev/null >"$run/console" 2>&1 || true
cat "$run/output" 2>/dev/null || true
if [ ! -s "$run/status" ]; then
  echo "vcan.sh: no end within $seconds s, or no start:" >&2
  tail -20 "$run/console" >&2
  exit 125
fi
exit "$(cat "$run/status")"
