"""Processes of this machine as /proc shows them."""

import ctypes
import os
from pathlib import Path

_LIBC = ctypes.CDLL(None, use_errno=True)
_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36
_CLONE_NEWNS, _MS_REC, _MS_PRIVATE = 0x20000, 0x4000, 0x40000


def end_with_parent():
    """In a child before its program starts: SIGKILL when the thread ends that started it."""
    _LIBC.prctl(_PR_SET_PDEATHSIG, 9)


def adopt_orphans():
    """Whoever loses its parent below this process becomes its child, and can be found."""
    if _LIBC.prctl(_PR_SET_CHILD_SUBREAPER, 1) != 0:
        raise OSError(ctypes.get_errno(), 'prctl(PR_SET_CHILD_SUBREAPER)')


def own_mounts():
    """What is mounted from now on is seen by this process and its children alone, and goes with them. False where that is not allowed."""
    return os.geteuid() == 0 and _LIBC.unshare(_CLONE_NEWNS) == 0 and _LIBC.mount(b'none', b'/', None, _MS_REC | _MS_PRIVATE, None) == 0


def _stat(pid):
    """State and parent; None where there is no such process."""
    try:
        fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    except OSError:
        return None
    return fields[0], int(fields[1])


def tree():
    """Parent → its children that are no zombies; and the zombies that are children of this process."""
    children, zombies = {}, []
    for entry in os.listdir('/proc'):
        if entry.isdigit() and (stat := _stat(entry)):
            state, parent = stat
            if state != 'Z':
                children.setdefault(parent, []).append(int(entry))
            elif parent == os.getpid():
                zombies.append(int(entry))
    return children, zombies


def below(pid, children):
    """All descendants."""
    found, waiting = [], [pid]
    while waiting:
        more = children.get(waiting.pop(), [])
        found += more
        waiting += more
    return found


def name_of(pid):
    try:
        return Path(f'/proc/{pid}/cmdline').read_bytes().replace(b'\0', b' ').decode(errors='replace').strip()[:120]
    except OSError:
        return '?'


def resident_bytes(pid):
    try:
        return int(Path(f'/proc/{pid}/statm').read_text().split()[1]) * os.sysconf('SC_PAGE_SIZE')
    except OSError:
        return 0


def count(pid, what):
    """Entries of a folder of /proc/PID: 'fd' or 'task'."""
    try:
        return len(os.listdir(f'/proc/{pid}/{what}'))
    except OSError:
        return 0


def files_below(folder):
    """Files, and their bytes. What goes meanwhile is not counted."""
    files = size = 0
    for path, _, names in os.walk(folder):
        for name in names:
            try:
                size += os.lstat(os.path.join(path, name)).st_size
                files += 1
            except OSError:
                pass
    return files, size
