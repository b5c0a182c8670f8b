"""Finds the socket of an agent of this user on this machine, as client/endpoint.h does in C++."""
import os
import pathlib
import socket
import stat
from typing import Iterator, List

from moondb.team_file import PathLike, team_of

ENDPOINT_BYTES_MAX = 4096


def endpoint_of(team_file: PathLike, agent: str) -> str:
    """Returns the endpoint at which the agent accepts clients that run as its user. Tries the one that its data folder beside
    the team file names, then the folders for sockets, and skips folders in which other users can write. If no process
    listens, returns the endpoint that an agent with this process's environment would use."""
    name, team_id = team_of(team_file)
    paths = [folder.absolute() / f"{name}-{team_id[:8]}" / f"{agent}.sock" for folder in _run_folders()]
    data_folder = pathlib.Path(team_file).absolute().parent / "moondb-data" / agent
    for path in [*_reported(data_folder), *paths]:
        if _is_private(path.parent) and _listens(path):
            return f"ipc://{path}"
    return f"ipc://{paths[0]}"


def _run_folders() -> List[pathlib.Path]:
    folders = []
    if os.environ.get("MOONDB_RUN_DIR"):
        folders.append(os.environ["MOONDB_RUN_DIR"])
    if os.environ.get("XDG_RUNTIME_DIR"):
        folders.append(os.path.join(os.environ["XDG_RUNTIME_DIR"], "moondb"))
    folders += [f"/tmp/moondb-{os.geteuid()}", f"/run/user/{os.geteuid()}/moondb"]
    return [pathlib.Path(folder) for folder in folders]


def _reported(data_folder: pathlib.Path) -> Iterator[pathlib.Path]:
    try:
        with open(data_folder / "agent.endpoint", encoding="utf-8") as file:
            line = file.readline(ENDPOINT_BYTES_MAX).rstrip("\n")
    except (OSError, UnicodeDecodeError):
        return
    if line.startswith("ipc://"):
        yield pathlib.Path(line[len("ipc://"):])


def _is_private(folder: pathlib.Path) -> bool:
    """Returns whether the folder belongs to this user, with mode 0700, and nobody else can replace it."""
    trusted = (0, os.geteuid())
    try:
        own, link, parent = os.lstat(folder), os.lstat(folder.parent), os.stat(folder.parent)
    except OSError:
        return False
    is_replaceable = parent.st_mode & (stat.S_IWGRP | stat.S_IWOTH) and not parent.st_mode & stat.S_ISVTX
    return (stat.S_ISDIR(own.st_mode) and own.st_uid == os.geteuid() and not own.st_mode & 0o077
            and link.st_uid in trusted and parent.st_uid in trusted and not is_replaceable)


def _listens(path: pathlib.Path) -> bool:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        probe.setblocking(False)
        try:
            probe.connect(str(path))
        except (OSError, ValueError):
            return False
    return True
