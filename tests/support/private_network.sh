#!/bin/sh
# Runs a command in a network namespace of its own where only the loopback exists and multicast stays on it:
# python-can's udp_multicast listens on every address and follows the default route.
exec unshare --net sh -c '
    ip link set lo up multicast on &&
    ip route add 224.0.0.0/4 dev lo &&
    exec "$@"' sh "$@"
