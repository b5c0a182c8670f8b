#!/usr/bin/env python3
"""Checks with readelf that each program has the protections that cmake/MoondbHarden.cmake sets.

Usage: hardening_test.py PROGRAMS [--no-fortify]    PROGRAMS is the folder of moonctl and the others; --no-fortify: for
                                                    a build without optimisation or with a sanitizer.
Exit codes: 0 all programs have them, 1 some lack one, 77 skipped (readelf is missing).
"""
import pathlib
import platform
import re
import shutil
import subprocess
import sys

# Instruction that marks a permitted target of indirect jumps: endbr64 or bti c.
LANDINGS = {"x86_64": bytes.fromhex("f30f1efa"), "aarch64": bytes.fromhex("3f2303d5")}
LANDINGS_MIN = 100
NAMES = ["moondb_agent", "moonctl", "moondb_mission", "moondb_replay", "moondb_sim"]


def shown(path, *options):
    return subprocess.run(["readelf", "-W", *options, path], capture_output=True, text=True, check=True).stdout


def lacking(path, is_fortified):
    """Returns the protections that the program lacks, one per line."""
    header, segments = shown(path, "-h"), shown(path, "-l", "-d")
    symbols = shown(path, "--dyn-syms")
    if "DYN" not in header:
        yield "is not built to be loaded anywhere (PIE)"
    if re.search(r"GNU_STACK.* RWE ", segments) or "GNU_STACK" not in segments:
        yield "has a stack that can be run"
    if "GNU_RELRO" not in segments or "BIND_NOW" not in segments:
        yield "has tables of the linker that can be written (full RELRO)"
    if "__stack_chk_fail" not in symbols:
        yield "has no guarded stacks"
    if is_fortified and not re.search(r"__\w+_chk\b", symbols.replace("__stack_chk_fail", "")):
        yield "has no checked buffers (_FORTIFY_SOURCE)"
    landing = LANDINGS.get(platform.machine())
    if landing and path.read_bytes().count(landing) < LANDINGS_MIN:
        yield "has no checked jumps (-fcf-protection, -mbranch-protection)"


def main():
    if shutil.which("readelf") is None:
        print("skipped: readelf is missing")
        return 77
    programs = [pathlib.Path(sys.argv[1]) / name for name in NAMES]
    lines = [f"{path.name} {line}" for path in programs for line in lacking(path, "--no-fortify" not in sys.argv)]
    print("\n".join(lines) if lines else f"{len(programs)} programs, each hardened")
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
