#!/bin/busybox sh
# Process 1 until the root file system is there: loads the drivers of what it finds, mounts root= read-only, hands over to systemd.
# What is mounted already stays as it is.
export PATH=/bin

say() { echo "bowwave: $*" >/dev/kmsg; }

mounted() { grep -q " $1 " /proc/mounts; }

# A gun computer has no keyboard: a start that fails is tried again.
fail() {
    say "$*; restarting in 10 s"
    sleep 10
    reboot -f
}

[ -e /proc/mounts ] || mount -t proc -o nosuid,nodev,noexec proc /proc
mounted /sys || mount -t sysfs -o nosuid,nodev,noexec sys /sys
mounted /dev || mount -t devtmpfs -o nosuid,mode=0755 dev /dev
mounted /run || mount -t tmpfs -o nosuid,nodev,mode=0755,size=20% run /run

# Prints the nodes that root= means, a device node or PARTLABEL=. There are several where a computer that has the image is started
# from a stick that has it, too.
find_roots() {
    case $root in
        PARTLABEL=*)
            for name in $(grep -lx "PARTNAME=${root#PARTLABEL=}" /sys/class/block/*/uevent 2>/dev/null); do
                name=${name%/uevent}
                echo "/dev/${name##*/}"
            done
            ;;
        *) [ ! -b "$root" ] || echo "$root" ;;
    esac
}

# Mounts the root file system that this kernel belongs to, and sets node.
mount_root() {
    for node in $(find_roots); do
        mount -t squashfs -o ro,nodev "$node" /new 2>/dev/null || continue
        [ ! -d "/new/lib/modules/$(uname -r)" ] || return 0
        umount /new
    done
    return 1
}

root=PARTLABEL=bowwave-root
for word in $(cat /proc/cmdline); do
    case $word in
        root=*) root=${word#root=} ;;
    esac
done

# Drivers bring new devices, which want drivers: until the root device is there. 20 s is what a slow USB stick takes.
tries=0
until mount_root; do
    [ $tries -lt 200 ] || fail "no device $root with a squashfs for Linux $(uname -r), only: $(find_roots | tr '\n' ' ')"
    cat /sys/bus/*/devices/*/modalias 2>/dev/null | sort -u >/aliases
    if cmp -s /aliases /aliases.seen; then
        usleep 100000
    else
        xargs modprobe -a -q </aliases 2>/dev/null
        mv /aliases /aliases.seen
    fi
    tries=$((tries + 1))
done

# The same machine has the same identity at each start, although nothing can be written to /etc: one journal, not one a start.
disk=/sys/class/block/${node##*/}
[ ! -e "$disk/partition" ] || disk=$disk/..
cat /sys/class/dmi/id/product_uuid /sys/class/dmi/id/board_serial /sys/class/dmi/id/product_serial \
    "$disk/serial" "$disk/device/serial" "$disk/device/cid" "$disk/device/wwid" 2>/dev/null |
    sha256sum | cut -c 1-32 >/run/machine-id
mount --bind /run/machine-id /new/etc/machine-id

for place in proc sys dev run; do
    mount --move "/$place" "/new/$place"
done
exec switch_root /new /sbin/init
