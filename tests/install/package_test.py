#!/usr/bin/env python3
"""Installs the packages of tools/package in clean systems, runs a team there, and removes them again.

Usage: package_test.py SOURCE WORK [TARBALL]
    SOURCE    the source tree, with a complete build in build/dev
    WORK      folder for the clean systems; kept, so that the next run is faster
    TARBALL   the one of `tools/package tarball --on jammy`: test it alone, on a root with libc6 of Ubuntu 22.04

The systems are a Debian 12 made by debootstrap, and a root that holds nothing but glibc and a shell.
Exit codes: 0 passed, 1 failed, 77 skipped (not root, no debootstrap, no network; it says which).
"""
import contextlib
import os
import pathlib
import re
import shutil
import stat
import subprocess
import sys
import time
import urllib.request

SKIPPED = 77
MIRROR = "http://deb.debian.org/debian"
LIMIT_S = 900

# Runs a team of four with nothing but the programs and a shell.
TEAM = """
set -e
rm -rf /root/moon /tmp/moondb-0
cd /root
moonctl config init --agents 4 moon/team.yaml
export MOONDB_TEAM=/root/moon/team.yaml
moonctl up
moonctl -a rover2 record insert temperature '{"celsius": 20}'
moonctl sync now --wait
moonctl -a rover1 record list temperature
moonctl health
EXTRA
moonctl down
"""
# Runs moondb_ros with a robot of Fast DDS, ROS 2's default middleware. moondb_ros check listens meanwhile.
ROS = """
set -e
cd /root
moonctl config init --agents 2 moon/team.yaml
export MOONDB_TEAM=/root/moon/team.yaml
moonctl -a rover1 up --with ros
moondb_ros check & check=$!
while kill -0 $check 2>/dev/null; do
  LD_LIBRARY_PATH=/opt/peer /opt/peer/fast_dds_peer 0 120
done
wait $check
moonctl down
"""
SAYS = [r"rover1 +good", "sync at rover1: all records are acknowledged", r"2\.[0-9a-f]{16}\.1\.1 +temperature +rover2"]


class Failure(Exception):
    """An error described in one line."""


class Skip(Exception):
    """The reason why this machine cannot run the test."""


def run(*command, **options):
    done = subprocess.run([str(part) for part in command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          timeout=LIMIT_S, check=False, **options)
    if done.returncode != 0:
        raise Failure(f"{' '.join(str(part) for part in command)[:300]} ended with {done.returncode}:\n{done.stdout[-4000:]}")
    return done.stdout


def inside(root, script, path="/usr/sbin:/usr/bin:/sbin:/bin", network=False):
    """Runs a shell script in a root, with /proc, and in a network of its own unless `network` is set."""
    prepare = "" if network else "ip link set lo up && "
    command = f'{prepare}mount -t proc proc "$0/proc" && exec chroot "$0" /bin/sh -c "$1"'
    spaces = ["--mount"] if network else ["--mount", "--net"]
    environment = {"PATH": path, "HOME": "/root", "DEBIAN_FRONTEND": "noninteractive", "LC_ALL": "C"}
    return run("unshare", *spaces, "/bin/sh", "-c", command, root, script,
               env=dict(environment, PATH=f"{path}:{os.environ['PATH']}"))


def files_in(root):
    """Returns all files outside of the folders of data, temporary files and package managers."""
    left_out = ("proc", "sys", "dev", "run", "tmp", "root", "var/lib/apt", "var/lib/dpkg", "var/cache", "var/log")
    found = set()
    for folder, _, names in os.walk(root):
        relative = os.path.relpath(folder, root)
        if any(relative == part or relative.startswith(part + "/") for part in left_out):
            continue
        found.update(os.path.join(relative, name) for name in names)
    return found


def check_team(said, where):
    for text in SAYS:
        if not re.search(text, said):
            raise Failure(f"on {where}, the team did not print '{text}':\n{said}")


def debian(work):
    root = work / "bookworm"
    if not (root / "made").exists():
        shutil.rmtree(root, ignore_errors=True)
        run("debootstrap", "--variant=minbase", "bookworm", root, MIRROR)
        (root / "made").touch()
    return root


def bare(work, name, libc):
    """Makes a root of glibc and a static shell. `libc`: the .deb of libc6."""
    root = work / name
    shutil.rmtree(root, ignore_errors=True)
    for folder in ("proc", "tmp", "root", "opt", "bin"):
        (root / folder).mkdir(parents=True)
    (root / "dev").mkdir()
    os.mknod(root / "dev/null", 0o666 | stat.S_IFCHR, os.makedev(1, 3))
    os.mknod(root / "dev/urandom", 0o666 | stat.S_IFCHR, os.makedev(1, 9))
    packages = work / "packages"
    run("apt-get", "download", "busybox-static", cwd=packages)
    for deb in (libc, next(packages.glob("busybox-static_*.deb"))):
        run("dpkg", "-x", deb, root)
    busybox = next(path for path in (root / "bin/busybox", root / "usr/bin/busybox") if path.exists())
    (root / "bin/sh").symlink_to("/" + str(busybox.relative_to(root)))
    return root


def libc_of(work, ubuntu=None):
    """Downloads the libc6 package of this Debian 12 (2.36), or of the root of an Ubuntu."""
    packages = work / "packages"
    packages.mkdir(parents=True, exist_ok=True)
    if ubuntu is None:
        run("apt-get", "download", "libc6", cwd=packages)
        return next(packages.glob("libc6_2.36*.deb"))
    inside(ubuntu, "cd /root && apt-get download libc6", network=True)
    return next((ubuntu / "root").glob("libc6_*.deb"))


def check_ros(root, folder, peer):
    """Runs moondb_ros of the tarball in `folder` with the Fast DDS program `peer`, which comes with its libraries."""
    shutil.rmtree(root / "root/moon")
    (root / "opt/peer").mkdir()
    for library in re.findall(r"=> (/\S+)", run("ldd", peer)):
        # The root has glibc's own libraries.
        if not re.match(r"(libc|libm|libpthread|libdl|librt)\.so", os.path.basename(library)):
            shutil.copy(library, root / "opt/peer")
    shutil.copy(peer, root / "opt/peer")
    said = inside(root, ROS, path=f"/opt/{folder.name}/bin:/usr/bin:/bin")
    for text in (r"moondb_ros of rover1 .*started", "odom to base_link", "odometry and maps work"):
        if not re.search(text, said):
            raise Failure(f"on {root.name}, moondb_ros did not print '{text}':\n{said}")
    shutil.rmtree(root / "opt/peer")


def check_tarball(root, tarball, peer=None):
    """Unpacks the tarball in /opt, runs a team, and moondb_ros if there is a peer, and removes the folder again."""
    before = files_in(root)
    run("tar", "-xzf", tarball, "-C", root / "opt")
    folder = next((root / "opt").glob("moondb-*"))
    said = inside(root, TEAM.replace("EXTRA", ""), path=f"/opt/{folder.name}/bin:/usr/bin:/bin")
    check_team(said, root.name)
    if peer is not None:
        check_ros(root, folder, peer)
    shutil.rmtree(folder)
    shutil.rmtree(root / "root/moon")
    left = files_in(root) - before | {str(file) for file in root.glob("tmp/moondb-*/**/*.sock")}
    if left:
        raise Failure(f"on {root.name}, the tarball left {sorted(left)[:5]}")


def check_debs(root, packages):
    """Installs the .deb packages, runs a team and the clients in Python and C++, and purges the packages."""
    for deb in packages.glob("*.deb"):
        shutil.copy(deb, root / "root")
    inside(root, "apt-get update -qq && apt-get install -y -qq --no-install-recommends g++ cmake make systemd", network=True)
    before = files_in(root)
    inside(root, "apt-get install -y -qq --no-install-recommends /root/*.deb", network=True)
    inside(root, "cmake -S /usr/share/moondb/examples/client -B /tmp/client && cmake --build /tmp/client")
    # The tarball's client is compiled from its sources.
    run("tar", "-xzf", next(packages.glob("*.tar.gz")), "-C", root / "opt")
    inside(root, "apt-get install -y -qq --no-install-recommends cppzmq-dev", network=True)
    inside(root, "cd /opt/moondb-* && cmake -S share/moondb/examples/client -B /tmp/client2 -DCMAKE_PREFIX_PATH=$PWD && "
           "cmake --build /tmp/client2 -j2 && grep -q '^moondb_DIR.*=/opt' /tmp/client2/CMakeCache.txt && rm -rf /opt/moondb-*")
    extra = """
/tmp/client/survey "$(cat moon/moondb-data/rover3/agent.endpoint)" rover3 3
python3 /usr/share/moondb/examples/python/survey.py $MOONDB_TEAM rover2 2
"""
    said = inside(root, TEAM.replace("EXTRA", extra))
    check_team(said, "Debian 12 with the packages")
    if said.count("stored 3 records") != 2:
        raise Failure(f"the clients did not store their records:\n{said}")
    check_unit(root)
    check_service(root)
    inside(root, "apt-get purge -y -qq moondb libmoondb-dev python3-moondb && apt-get autoremove --purge -y -qq",
           network=True)
    left = {name for name in files_in(root) - before if "moondb" in name}
    if left:
        raise Failure(f"the packages left {sorted(left)[:5]}")
    shutil.rmtree(root / "root/moon")


def check_unit(root):
    """Verifies the units, their user, and their exposure."""
    inside(root, "getent passwd moondb")
    for name in ("moondb-agent", "moondb-ros"):
        unit = f"/tmp/{name}@rover1.service"
        inside(root, f"cp /lib/systemd/system/{name}@.service {unit} && systemd-analyze verify {unit}")
        said = inside(root, f"systemd-analyze security --offline=true {unit} | tail -1")
        exposure = float(re.search(r": (\d+\.\d+)", said).group(1))
        if exposure >= 3.0:
            raise Failure(f"the exposure of {name} is {exposure}")


@contextlib.contextmanager
def booted(root):
    """Boots systemd in a root. Gives a function that runs a shell script there, or None if this machine boots none."""
    boot = subprocess.Popen(["systemd-nspawn", "--quiet", "--register=no", "--keep-unit", "--private-network", "--directory",
                             root, "/lib/systemd/systemd", "--unit=basic.target"],
                            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.STDOUT)
    try:
        def there(script):
            children = run("pgrep", "--parent", boot.pid).split()
            return run("nsenter", "--all", "--target", children[0], "/bin/sh", "-ec", script)
        try:
            wait_until(there, "systemctl is-active basic.target")
        except Failure:
            there = None
        yield there
    finally:
        boot.terminate()
        boot.wait(timeout=60)


def wait_until(there, script):
    """Runs a script again and again until it ends with 0."""
    end = time.monotonic() + 60
    while True:
        try:
            return there(script)
        except Failure:
            if time.monotonic() > end:
                raise
            time.sleep(0.5)


def check_service(root):
    """Runs a team as services of a systemd: a start, a kill, an agent that hangs, and a stop."""
    if not shutil.which("systemd-nspawn"):
        print("not tested: the service under systemd (package systemd-container)")
        return
    with booted(root) as there:
        if there is None:
            print("not tested: the service under systemd, because systemd-nspawn boots none here")
            return
        there("""
cd /root
rm -rf moon *.pack /var/lib/moondb
moonctl config init --agents 3 moon/team.yaml
for agent in rover1 rover2 base; do
  moonctl config pack $agent $agent.pack -t moon/team.yaml
  moonctl config unpack $agent.pack
done
mkdir -p /run/systemd/system/moondb-agent@.service.d
printf '[Service]\nWatchdogSec=25\nRestartSec=1\n' > /run/systemd/system/moondb-agent@.service.d/test.conf
systemctl daemon-reload
systemctl start moondb-agent@rover1 moondb-agent@rover2 moondb-agent@base
setpriv --reuid moondb --regid moondb --clear-groups env MOONDB_RUN_DIR=/run/moondb \
  moonctl -t /var/lib/moondb/team.yaml -a rover1 health
""")
        for signal, cause in (("KILL", "signal"), ("STOP", "watchdog")):
            restarts = there("systemctl show --property NRestarts --value moondb-agent@rover1").strip()
            there(f"systemctl kill --signal {signal} --kill-who main moondb-agent@rover1")
            wait_until(there, f"""
[ "$(systemctl show --property NRestarts --value moondb-agent@rover1)" -gt {restarts} ]
systemctl is-active moondb-agent@rover1
journalctl --unit moondb-agent@rover1 | grep "Failed with result '{cause}'"
""")
        there("""
systemctl stop moondb-agent@rover1 moondb-agent@rover2 moondb-agent@base
[ "$(systemctl show --property Result --value moondb-agent@rover1)" = success ]
rm -rf /var/lib/moondb /root/*.pack
""")


def check_machine(tarballs):
    if os.geteuid() != 0:
        raise Skip("needs root")
    for tool, package in (("debootstrap", "debootstrap"), ("unshare", "util-linux"), ("ip", "iproute2"),
                          ("patchelf", "patchelf"), ("dpkg-shlibdeps", "dpkg-dev")):
        if not shutil.which(tool):
            raise Skip(f"{tool} is missing (package {package})")
    if subprocess.run(["unshare", "--mount", "--net", "ip", "link", "set", "lo", "up"], capture_output=True,
                      check=False).returncode != 0:
        raise Skip("this machine makes no namespaces")
    if not tarballs:
        with open("/etc/os-release", encoding="utf-8") as release:
            if "VERSION_CODENAME=bookworm" not in release.read():
                raise Skip("the packages are for Debian 12, and this is another system")
    try:
        urllib.request.urlopen(MIRROR + "/dists/bookworm/Release", timeout=20).close()
    except OSError as error:
        raise Skip(f"{MIRROR} does not answer: {error}") from error


def main():
    if len(sys.argv) < 3:
        print(__doc__.strip(), file=sys.stderr)
        return 2
    source, work = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
    tarballs = [pathlib.Path(name).resolve() for name in sys.argv[3:]]
    try:
        check_machine(tarballs)
        work.mkdir(parents=True, exist_ok=True)
        for tarball in tarballs:
            check_tarball(bare(work, "bare-2.35", libc_of(work, source / "build/jammy")), tarball)
        if not tarballs:
            packages = source / "build/packages"
            with contextlib.suppress(FileNotFoundError):
                shutil.rmtree(packages)
            run(source / "tools/package", "tarball")
            run(source / "tools/package", "debs")
            tarball = next(packages.glob("*.tar.gz"))
            check_tarball(bare(work, "bare-2.36", libc_of(work)), tarball)
            check_tarball(debian(work), tarball, source / "build/dev/bin/fast_dds_peer")
            check_debs(debian(work), packages)
    except Skip as reason:
        print(f"skipped: {reason}")
        return SKIPPED
    except (Failure, subprocess.TimeoutExpired) as failure:
        print(f"failed: {failure}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
