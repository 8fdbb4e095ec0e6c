#!/usr/bin/env bash
# Runs a command of this project on a machine where nothing is installed.
#
#   scripts/fresh_machine.sh [--suite bookworm|trixie|testing] [--bring FILE] [COMMAND]
#
# The machine is a bare Debian root: the essential packages, git and make. It is built anew on
# every call with mmdebstrap. The script clones HEAD into it and runs COMMAND there as root, with
# an empty environment. COMMAND is a shell command; it is `make run` unless one is given. The suite
# is bookworm (Debian 12) unless one is given; trixie is Debian 13. testing is what becomes the next
# Debian; its name, forky, serves too. FILE lies in /srv of the machine.
#
# The output of COMMAND is shown as it comes and kept in build/fresh_machine/SUITE.log. The last
# line says whether COMMAND worked and how long it took. The exit code is COMMAND's, or 2 when the
# machine could not be built. The machine and all that runs in it is removed at the end.
#
# Packages come from where this machine gets its own: the script takes over apt's mirrors and its
# settings for transport, proxies, pip's configuration and the certificates. On a host that is no
# Debian, mmdebstrap's own default mirror is used.
#
# Needs root, mmdebstrap, and about 4 GB in $TMPDIR (/var/tmp unless it is set).
set -euo pipefail

say() { printf 'fresh_machine: %s\n' "$*" >&2; }
die() { say "$*"; exit 2; }
usage() { sed -n '2,/^set /s/^# \{0,1\}//p' "${BASH_SOURCE[0]}"; }

suite=bookworm bring=
while [ $# -gt 0 ]; do
  case "$1" in
    --suite) [ $# -gt 1 ] || die "--suite: bookworm, trixie or testing is missing"; suite="$2"; shift 2 ;;
    --suite=*) suite="${1#*=}"; shift ;;
    --bring) [ -f "${2:-}" ] || die "--bring: no file ${2:-is named}"; bring="$2"; shift 2 ;;
    -h | --help) usage; exit 0 ;;
    --) shift; break ;;
    -*) die "$1: no such option; --help shows what there is" ;;
    *) break ;;
  esac
done
case "$suite" in
  bookworm) release="Debian 12 (bookworm)" ;;
  trixie) release="Debian 13 (trixie)" ;;
  testing | forky) release="Debian testing (forky)" ;;
  *) die "--suite $suite: has to be bookworm, trixie or testing" ;;
esac
command="${*:-make run}"

[ "$(id -u)" -eq 0 ] || die "only root can build a machine: run it with sudo"
for tool in mmdebstrap git unshare chroot; do
  command -v "$tool" >/dev/null 2>&1 || die "$tool is not installed: apt-get install mmdebstrap git util-linux"
done
here="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
commit="$(git -C "$here" rev-parse --short HEAD 2>/dev/null)" || die "$here is no git repository"
[ -z "$(git -C "$here" status --porcelain)" ] || say "changes that are not committed are left out"

work="$(mktemp -d "${TMPDIR:-/var/tmp}/fresh-machine.XXXXXX")"
chmod 755 "$work"
machine="$work/root"
child=
# Everything in the machine runs below one process of its own namespaces, mounts included. When
# that process ends, the kernel ends and unmounts all of it.
cleanup() {
  trap '' INT TERM HUP
  if [ -n "$child" ] && kill -0 "$child" 2>/dev/null; then
    kill -TERM -- "-$child" 2>/dev/null || true
    wait "$child" 2>/dev/null || true
  fi
  rm -rf --one-file-system "$work" || { sleep 2; rm -rf --one-file-system "$work"; }
}
trap cleanup EXIT
trap 'exit 130' INT
trap 'exit 143' TERM
trap 'exit 129' HUP

# Runs a command in a process group of its own and waits so that a signal is served at once.
set -m
watched() {
  local code=0
  "$@" </dev/null &
  child=$!
  wait "$child" || code=$?
  child=
  return "$code"
}

# One line for each archive of this Debian and its updates, for SUITE: the suite's name replaced.
# Debian testing gets its updates in its archive, so the others are left out there.
mirrors() {
  local codename
  codename="$(. /etc/os-release && [ "$ID" = debian ] && printf '%s' "${VERSION_CODENAME:-}")" || return 0
  [ -n "$codename" ] || return 0
  apt-get indextargets --format '$(REPO_URI) $(RELEASE) $(COMPONENT)' 'Created-By: Packages' |
    sed -nE "s#^(\S+) $codename(-updates|-security)? main\$#deb \1 $suite\2 main#p" | sort -u |
    case "$suite" in testing | forky) grep -vE -- '-(updates|security) main$' || true ;; *) cat ;; esac
}

log="$here/build/fresh_machine/$suite.log"
mkdir -p "$(dirname "$log")"
started=$SECONDS
say "building a bare $release in $work"

# Without its lists apt does not say which archives it has.
[ -n "$(mirrors)" ] || ! grep -q '^ID=debian' /etc/os-release || apt-get update -qq >&2 ||
  die "apt-get update failed"
mirrors >"$work/mirrors.list"
archives=()
[ ! -s "$work/mirrors.list" ] || archives=("$work/mirrors.list")
apt-config dump | grep -E '^Acquire::(http|https|ftp|Check-|Retries|Force|Max-|Queue)' >"$work/apt.conf" || true
watched mmdebstrap --mode=root --variant=minbase --include=ca-certificates,git,make \
  --aptopt="$work/apt.conf" "$suite" "$machine" "${archives[@]}" >&2 ||
  die "mmdebstrap could not build $release"

# The network as this machine sees it. A path that a variable names is copied to the same place.
keep=()
into_machine() {
  [ ! -f "$1" ] || { mkdir -p "$machine$(dirname "$1")" && cp -L "$1" "$machine$1"; }
}
for file in /etc/resolv.conf /etc/hosts /etc/ssl/certs/ca-certificates.crt /etc/pip.conf; do
  into_machine "$file"
done
for file in "$HOME/.config/pip/pip.conf" "$HOME/.pip/pip.conf"; do
  [ ! -f "$file" ] || { mkdir -p "$machine/root/.config/pip" && cp -L "$file" "$machine/root/.config/pip/pip.conf"; }
done
for name in {http,https,ftp,all,no}_proxy {HTTP,HTTPS,FTP,ALL,NO}_PROXY \
  PIP_{INDEX_URL,EXTRA_INDEX_URL,TRUSTED_HOST,PROXY,CERT,DEFAULT_TIMEOUT,RETRIES} SSL_CERT_FILE; do
  [ -n "${!name:-}" ] || continue
  keep+=("$name=${!name}")
  case "${!name}" in /*) into_machine "${!name}" ;; esac
done

git clone --quiet --no-local "$here" "$machine/srv/directmpc"
[ -z "$bring" ] || cp "$bring" "$machine/srv/"

# Runs as the first process of the machine's namespaces: devices and mounts, then the command.
cat >"$work/start" <<'START'
set -euo pipefail
machine="$1" command="$2"
shift 2
mount -t proc proc "$machine/proc"
mount -t tmpfs -o mode=755 tmpfs "$machine/dev"
for device in null zero full random urandom tty; do
  touch "$machine/dev/$device"
  mount --bind "/dev/$device" "$machine/dev/$device"
done
mkdir "$machine/dev/pts" "$machine/dev/shm"
mount -t devpts -o newinstance,ptmxmode=0666,mode=620 devpts "$machine/dev/pts"
mount -t tmpfs -o mode=1777 tmpfs "$machine/dev/shm"
ln -s pts/ptmx "$machine/dev/ptmx"
ln -s /proc/self/fd "$machine/dev/fd"
for i in 0,stdin 1,stdout 2,stderr; do ln -s "/proc/self/fd/${i%,*}" "$machine/dev/${i#*,}"; done
exec env -i --default-signal=INT,TERM,HUP,QUIT,PIPE HOME=/root TERM=dumb \
  PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin "$@" \
  chroot "$machine" /bin/bash -c 'cd /srv/directmpc; eval "$1"; exit' bash "$command"
START
in_machine() {
  unshare --mount --pid --fork --kill-child bash "$work/start" "$machine" "$command" "${keep[@]}" 2>&1 |
    tee "$log"
}
say "commit $commit, '$command', built in $((SECONDS - started)) s; log: ${log#"$here"/}"
started=$SECONDS code=0
watched in_machine || code=$?
took=$((SECONDS - started))
if [ "$code" -eq 0 ]; then
  say "'$command' works on a bare $release: $took s"
else
  say "'$command' fails on a bare $release: exit code $code after $took s; log: $log"
fi
exit "$code"
